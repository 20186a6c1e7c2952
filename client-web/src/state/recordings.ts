// The recordings of the session on show, asked for while somebody looks at them.

import { batch, computed, signal, type ReadonlySignal } from "@preact/signals-core";
import type { Recording } from "../protocol/recording";
import { decodeRecordings } from "../protocol/text";
import { type Outcome, refusalOf, saidIn } from "./api";
import type { Live } from "./live";
import type { Platform } from "./platform";
import { repeatedly } from "./repeatedly";

/** Looks whether another session is on show this often, ms. */
const LOOK_MS = 250;
/** Asked for this long after the last answer while one goes on, and while none does, ms. */
const RUNNING_MS = 1000;
const RESTING_MS = 5000;

export class Recordings {
  readonly #platform: Platform;
  readonly #live: Live;
  readonly #list = signal<readonly Recording[] | undefined>(undefined);
  readonly #refusal = signal<string | undefined>(undefined);
  readonly #isBusy = signal(false);
  readonly #running = computed(() => this.#list.value?.find(({ state }) => state === "recording"));
  #session = "";
  #answered_ms = Number.NEGATIVE_INFINITY;
  /** Counts what was asked, so that what was overtaken is not shown. */
  #turn = 0;

  constructor(platform: Platform, live: Live) {
    this.#platform = platform;
    this.#live = live;
  }

  /** Nothing before the first answer of this session. */
  get list(): ReadonlySignal<readonly Recording[] | undefined> {
    return this.#list;
  }

  /** The one that goes on. */
  get running(): ReadonlySignal<Recording | undefined> {
    return this.#running;
  }

  /** Why the last thing that was asked for was not done, or why there is no list. */
  get refusal(): ReadonlySignal<string | undefined> {
    return this.#refusal;
  }

  /** Whether something that was asked for is under way: a second press would be another one. */
  get isBusy(): ReadonlySignal<boolean> {
    return this.#isBusy;
  }

  /** Keeps the list new; returns what ends that. */
  watch(): () => void {
    return repeatedly(this.#platform, LOOK_MS, () => this.#look());
  }

  start(): Promise<boolean> {
    return this.#change((session) => this.#live.api.record(session));
  }

  end(recording: string): Promise<boolean> {
    return this.#change((session) => this.#live.api.endRecording(session, recording));
  }

  remove(recording: string): Promise<boolean> {
    return this.#change((session) => this.#live.api.deleteRecording(session, recording));
  }

  /** Returns whether it was done. */
  async #change(ask: (session: string) => Promise<Outcome>): Promise<boolean> {
    const session = this.#live.session.peek();
    if (session === undefined || this.#isBusy.peek()) return false;
    this.#isBusy.value = true;
    const outcome = await ask(session.id);
    this.#refusal.value = refusalOf(outcome);
    await this.#ask(session.id);
    this.#isBusy.value = false;
    return outcome.kind === "done";
  }

  async #look(): Promise<void> {
    const session = this.#live.session.peek();
    if (session === undefined || !this.#live.isCurrent.peek()) return;
    if (session.id !== this.#session) {
      this.#session = session.id;
      this.#answered_ms = Number.NEGATIVE_INFINITY;
      batch(() => {
        this.#list.value = undefined;
        this.#refusal.value = undefined;
      });
    }
    const wait_ms = this.#running.peek() === undefined ? RESTING_MS : RUNNING_MS;
    if (this.#platform.now_ms() - this.#answered_ms < wait_ms) return;
    await this.#ask(session.id);
  }

  async #ask(session: string): Promise<void> {
    this.#turn += 1;
    const turn = this.#turn;
    const found = await this.#listOf(session);
    this.#answered_ms = this.#platform.now_ms();
    if (turn !== this.#turn || session !== this.#live.session.peek()?.id) return;
    batch(() => {
      if (typeof found !== "string") this.#list.value = found;
      // A refusal stays beside its button; there is no room for two.
      else if (this.#list.peek() === undefined) this.#refusal.value = found;
    });
  }

  /** The recordings, or why there is no list. */
  async #listOf(session: string): Promise<Recording[] | string> {
    try {
      const answer = await this.#platform.request("GET", this.#live.api.recordingsPath(session));
      return answer.status === 200 ? decodeRecordings(answer.body) : saidIn(answer).detail;
    } catch {
      return "the recordings of this session are not to be had";
    }
  }
}
