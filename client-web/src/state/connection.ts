// The stream from the server: opened, watched, and opened again for as long as the page lives.

import { signal, type ReadonlySignal } from "@preact/signals-core";
import { isDamaged, type SessionEntry } from "../protocol/session";
import { decodeProblem, decodeSessions, encodeText, SUBPROTOCOL } from "../protocol/text";
import type { Platform, Socket, SocketEnd } from "./platform";

export const API = "api/v1";

export type Phase =
  | { readonly name: "connecting" }
  | { readonly name: "open"; readonly session: string }
  /**
   * Nobody answers; `attempts` have failed in a row. `because` is what the server said when it closed the stream, if it
   * said anything.
   */
  | { readonly name: "away"; readonly attempts: number; readonly retryAt_ms: number; readonly because: string | undefined }
  /** The server answers, and has no session to show. */
  | { readonly name: "empty" }
  /** The server answers, and wants another token, or one at all; `because` is what it says. */
  | { readonly name: "locked"; readonly because: string };

export interface StreamHandlers {
  onText(text: string): void;
  onBinary(bytes: ArrayBuffer): void;
}

/**
 * First pause after a failure; it doubles up to the longest. Each is drawn from its upper half, so that many pages do
 * not return at once.
 */
const FIRST_PAUSE_MS = 250;
const LONGEST_PAUSE_MS = 4000;
const PING_EVERY_MS = 1000;
/**
 * State comes several times a second; after this many pings in a row without a word the server is as good as away.
 * Counted, not timed: a page that was itself too busy to listen finds the words waiting when it is back.
 */
const SILENT_PINGS = 3;
/** Looks for a session this often while there is none. */
const SEARCH_EVERY_MS = 1500;

export class Connection {
  readonly #phase = signal<Phase>({ name: "connecting" });
  readonly #sessions = signal<readonly string[]>([]);
  /** Round trip page to server, ms; nothing before the first answer. */
  readonly #ping_ms = signal<number | undefined>(undefined);
  readonly #platform: Platform;
  readonly #handlers: StreamHandlers;
  #wanted: string | undefined;
  #socket: Socket | undefined;
  #attempts = 0;
  /** Counts attempts, so that what an abandoned one still brings is ignored. */
  #turn = 0;
  #cancel: () => void = () => undefined;
  #silent = 0;
  #nonce = 0;
  #pinged_ms = 0;

  constructor(platform: Platform, handlers: StreamHandlers) {
    this.#platform = platform;
    this.#handlers = handlers;
  }

  get phase(): ReadonlySignal<Phase> {
    return this.#phase;
  }

  get sessions(): ReadonlySignal<readonly string[]> {
    return this.#sessions;
  }

  get ping_ms(): ReadonlySignal<number | undefined> {
    return this.#ping_ms;
  }

  /** Opens the stream of `session`, or of the first one there is. */
  open(session: string | undefined): void {
    this.#wanted = session;
    this.#attempts = 0;
    void this.#attempt();
  }

  /** Hears from elsewhere which sessions there are. */
  know(sessions: readonly string[]): void {
    const before = this.#sessions.peek();
    if (sessions.length !== before.length || sessions.some((id, n) => id !== before[n])) this.#sessions.value = sessions;
    // There is something to show now, and one need not wait to find that out.
    if (0 < sessions.length && this.#phase.peek().name === "empty") void this.#attempt();
  }

  /** Does not wait for the pause to end. */
  retryNow(): void {
    if (this.#phase.value.name !== "open") void this.#attempt();
  }

  close(): void {
    this.#abandon();
  }

  onPong(nonce: number): void {
    if (nonce === this.#nonce) this.#ping_ms.value = this.#platform.now_ms() - this.#pinged_ms;
  }

  async #attempt(): Promise<void> {
    this.#abandon();
    const turn = this.#turn;
    const known = await this.#list();
    if (turn !== this.#turn) return;
    if (known === undefined) {
      this.#pause();
      return;
    }
    if (typeof known === "string") {
      // Asked again when there is another token: each wrong one counts.
      this.#phase.value = { name: "locked", because: known };
      return;
    }
    this.#sessions.value = known;
    const session = this.#wanted !== undefined && known.includes(this.#wanted) ? this.#wanted : known.at(0);
    if (session === undefined) {
      this.#phase.value = { name: "empty" };
      this.#cancel = this.#platform.after(SEARCH_EVERY_MS, () => void this.#attempt());
      return;
    }
    this.#connect(session, turn);
  }

  /** The sessions; in words, why the server does not tell them; nothing if nobody answers. */
  async #list(): Promise<string[] | string | undefined> {
    try {
      const answer = await this.#platform.request("GET", `${API}/sessions`);
      if (answer.status === 401 || answer.status === 429) {
        return decodeProblem(answer.body)?.detail ?? `status ${answer.status}`;
      }
      return answer.status === 200 ? idsOf(decodeSessions(answer.body)) : undefined;
    } catch {
      return undefined; // nobody answers, or somebody else does: either way the server is away
    }
  }

  #connect(session: string, turn: number): void {
    const current = (): boolean => turn === this.#turn;
    this.#silent = 0;
    this.#socket = this.#platform.connect(`${API}/sessions/${encodeURIComponent(session)}/stream`, SUBPROTOCOL, {
      onOpen: () => {
        if (!current()) return;
        this.#attempts = 0;
        this.#hear();
        this.#socket?.send(encodeText({ type: "subscribe", telemetry: "on", bricks: "on" }));
        this.#phase.value = { name: "open", session };
      },
      onText: (text) => {
        if (!current()) return;
        this.#hear();
        this.#handlers.onText(text);
      },
      onBinary: (bytes) => {
        if (!current()) return;
        this.#hear();
        this.#handlers.onBinary(bytes);
      },
      onClose: (end) => {
        if (current()) this.#pause(saidOf(end));
      },
    });
    this.#watch();
  }

  #hear(): void {
    this.#silent = 0;
  }

  /** Asks for a sign of life every second; a socket can stay open long after the server behind it has stopped. */
  #watch(): void {
    this.#cancel = this.#platform.after(PING_EVERY_MS, () => {
      this.#silent += 1;
      if (SILENT_PINGS < this.#silent) {
        this.#pause();
        return;
      }
      if (this.#phase.value.name === "open") {
        this.#nonce += 1;
        this.#pinged_ms = this.#platform.now_ms();
        this.#socket?.send(encodeText({ type: "ping", nonce: this.#nonce }));
      }
      this.#watch();
    });
  }

  #pause(because?: string): void {
    this.#abandon();
    const longest = Math.min(FIRST_PAUSE_MS * 2 ** this.#attempts, LONGEST_PAUSE_MS);
    const pause_ms = longest * (0.5 + this.#platform.random() / 2);
    this.#attempts += 1;
    this.#phase.value = {
      name: "away",
      attempts: this.#attempts,
      retryAt_ms: this.#platform.now_ms() + pause_ms,
      because,
    };
    this.#cancel = this.#platform.after(pause_ms, () => void this.#attempt());
  }

  #abandon(): void {
    this.#turn += 1;
    this.#cancel();
    this.#cancel = () => undefined;
    const socket = this.#socket;
    this.#socket = undefined;
    socket?.close();
    this.#ping_ms.value = undefined;
    if (this.#phase.value.name === "open") this.#phase.value = { name: "connecting" };
  }
}

/** The sessions that can be opened. */
export function idsOf(entries: readonly SessionEntry[]): string[] {
  return entries.filter((entry) => !isDamaged(entry)).map(({ id }) => id);
}

/** Why the server closed; nothing when the connection just broke. */
function saidOf({ code, reason }: SocketEnd): string | undefined {
  return reason === "" ? undefined : `${reason} (code ${code})`;
}
