// Everything the Live page shows: the session as the server tells it, telemetry, events, and whether any of it is
// current.

import { batch, computed, signal, type ReadonlySignal } from "@preact/signals-core";
import { decodeHeader, Kind } from "../protocol/header";
import type { ClayShape, Session, SessionPatch, ToolState } from "../protocol/session";
import { decodeTelemetry } from "../protocol/telemetry";
import { decodeServerText, type ServerEvent } from "../protocol/text";
import { Api, type Outcome } from "./api";
import { Connection } from "./connection";
import { Edits } from "./edits";
import { History } from "./history";
import type { Platform } from "./platform";
import { Playhead } from "./playhead";
import { type Quality, QualityTrend } from "./quality";
import { Memory } from "./samples";
import { sharing } from "./sharing";
import { type StorageNews, StorageWatch } from "./storage_watch";

const EVENTS_KEPT = 50;

/** Something the server said, or that went wrong with what it said. */
export interface Notice {
  readonly id: number;
  readonly level: ServerEvent["level"];
  readonly text: string;
  readonly time_s: number | undefined;
}

export class Live {
  readonly connection: Connection;
  readonly edits: Edits;
  readonly api: Api;
  /** Where brick messages go, undecoded: the clay worker. */
  onBricks: ((bytes: ArrayBuffer) => void) | undefined;

  readonly #session = signal<Session | undefined>(undefined);
  readonly #quality = signal<Quality>({ loss: undefined, latePerS: 0 });
  readonly #storage = signal<StorageNews>("fine");
  readonly #notices = signal<readonly Notice[]>([]);
  readonly #serverVersion = signal<string | undefined>(undefined);
  readonly #toolId = signal<number | undefined>(undefined);
  readonly #histories = new Map<number, History>();
  readonly #memory = new Memory();
  readonly #playhead = new Playhead();
  readonly #platform: Platform;
  #trend = new QualityTrend();
  #storageWatch = new StorageWatch();
  #notice = 0;
  /** Bytes of stream received, for the rate a watcher costs. */
  received_bytes = 0;

  /** The tool on show, as the last state message had it: the chosen one, else the first that somebody holds. */
  readonly tool: ReadonlySignal<ToolState | undefined> = computed(() => {
    const tools = this.#session.value?.tools;
    return tools?.find(({ id }) => id === this.#toolId.value) ?? tools?.find(({ connected }) => connected) ?? tools?.at(0);
  });

  /** Whether what is shown is current. */
  readonly isCurrent: ReadonlySignal<boolean> = computed(() => this.connection.phase.value.name === "open");

  constructor(platform: Platform) {
    this.#platform = platform;
    this.api = new Api(platform);
    this.connection = new Connection(platform, {
      onText: (text) => this.#onText(text),
      onBinary: (bytes) => this.#onBinary(bytes),
    });
    this.edits = new Edits((delay_ms, run) => platform.after(delay_ms, run), (patch) => this.#patch(patch));
  }

  get session(): ReadonlySignal<Session | undefined> {
    return this.#session;
  }

  get quality(): ReadonlySignal<Quality> {
    return this.#quality;
  }

  /** Whether the disk keeps up with the session. */
  get storage(): ReadonlySignal<StorageNews> {
    return this.#storage;
  }

  get notices(): ReadonlySignal<readonly Notice[]> {
    return this.#notices;
  }

  get serverVersion(): ReadonlySignal<string | undefined> {
    return this.#serverVersion;
  }

  /** Telemetry of the tool on show. */
  get history(): History {
    return this.historyOf(this.tool.peek()?.id ?? this.#toolId.peek() ?? 1);
  }

  /** The moment to show at `now_ms`, in the session's time, s. */
  momentAt(now_ms: number): number {
    return this.#playhead.at(now_ms, this.history.newest_s);
  }

  historyOf(tool: number): History {
    let history = this.#histories.get(tool);
    if (history === undefined) {
      history = new History(this.#memory);
      this.#histories.set(tool, history);
    }
    return history;
  }

  showTool(id: number): void {
    this.#toolId.value = id;
  }

  /** Shows another session, or the first there is. */
  open(session: string | undefined): void {
    batch(() => {
      this.#session.value = undefined;
      this.#startOver();
      this.connection.open(session);
    });
  }

  async resetClay(shape: ClayShape | undefined): Promise<Outcome> {
    const session = this.#session.peek();
    if (session === undefined) return { kind: "away" };
    const outcome = await this.api.reset(session.id, shape === undefined ? {} : { shape });
    this.adopt(outcome);
    return outcome;
  }

  /** Shows what an answer says about the session on show, before the stream does. */
  adopt(outcome: Outcome): void {
    const told = outcome.kind === "done" ? outcome.session : undefined;
    if (told !== undefined && told.id === this.#session.peek()?.id) this.#show(told);
  }

  report(level: Notice["level"], text: string, time_s?: number): void {
    this.#notice += 1;
    const notice = { id: this.#notice, level, text, time_s };
    this.#notices.value = [notice, ...this.#notices.value].slice(0, EVENTS_KEPT);
  }

  async #patch(patch: SessionPatch): Promise<Outcome> {
    const session = this.#session.peek();
    if (session === undefined) return { kind: "away" };
    const outcome = await this.api.patch(session.id, patch);
    this.adopt(outcome);
    return outcome;
  }

  #show(session: Session): void {
    this.#session.value = sharing(this.#session.peek(), session);
    this.#storage.value = this.#storageWatch.look(session.storage.state, this.#platform.now_ms());
  }

  #startOver(): void {
    this.edits.forget();
    this.#trend = new QualityTrend();
    this.#storageWatch = new StorageWatch();
    for (const history of this.#histories.values()) history.dispose();
    this.#histories.clear();
  }

  #onText(text: string): void {
    this.received_bytes += text.length;
    try {
      const message = decodeServerText(text);
      switch (message.type) {
        case "hello":
          this.#serverVersion.value = message.server_version;
          this.#startOver(); // perhaps another run of the server, whose clock starts anew
          return;
        case "state":
          batch(() => {
            this.#show(message.session);
            this.#quality.value = this.#trend.add(message.session);
          });
          return;
        case "event":
          this.report(message.level, message.text, message.time_s);
          return;
        case "problem":
          this.report("error", message.problem.detail);
          return;
        case "pong":
          this.connection.onPong(message.nonce);
          return;
      }
    } catch (error) {
      this.#undecodable(error);
    }
  }

  #onBinary(bytes: ArrayBuffer): void {
    this.received_bytes += bytes.byteLength;
    try {
      if (decodeHeader(new DataView(bytes)).kind === Kind.bricks) {
        this.onBricks?.(bytes);
        return;
      }
      const telemetry = decodeTelemetry(bytes);
      this.historyOf(telemetry.tool).append(telemetry);
    } catch (error) {
      this.#undecodable(error);
    }
  }

  #undecodable(error: unknown): void {
    const reason = error instanceof Error ? error.message : String(error);
    const text = `message not understood: ${reason}`;
    // Said once: a server of another version would fill the list with one line.
    if (this.#notices.peek().at(0)?.text !== text) this.report("error", text);
  }
}
