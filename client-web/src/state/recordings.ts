// The recordings of the session on show.

import { computed, type ReadonlySignal } from "@preact/signals-core";
import type { Recording } from "../protocol/recording";
import { decodeRecordings } from "../protocol/text";
import type { Live } from "./live";
import { Listing } from "./listing";
import type { Platform } from "./platform";

/** Asked for this long after the last answer while one goes on, and while none does, ms. */
const RUNNING_MS = 1000;
const RESTING_MS = 5000;

export class Recordings {
  readonly #live: Live;
  readonly #listing: Listing<readonly Recording[]>;
  readonly #running = computed(() => this.list.value?.find(({ state }) => state === "recording"));

  constructor(platform: Platform, live: Live) {
    this.#live = live;
    this.#listing = new Listing<readonly Recording[]>(platform, live, {
      path: (session) => live.api.recordingsPath(session),
      decode: decodeRecordings,
      missing: "the recordings of this session are not to be had",
      isDue: (_session, since_ms) => (this.#running.peek() === undefined ? RESTING_MS : RUNNING_MS) <= since_ms,
    });
  }

  /** Nothing before the first answer of this session. */
  get list(): ReadonlySignal<readonly Recording[] | undefined> {
    return this.#listing.found;
  }

  /** The one that goes on. */
  get running(): ReadonlySignal<Recording | undefined> {
    return this.#running;
  }

  /** Why the last thing that was asked for was not done, or why there is no list. */
  get refusal(): ReadonlySignal<string | undefined> {
    return this.#listing.refusal;
  }

  /** Whether something that was asked for is under way: a second press would be another one. */
  get isBusy(): ReadonlySignal<boolean> {
    return this.#listing.isBusy;
  }

  /** Keeps the list new; returns what ends that. */
  watch(): () => void {
    return this.#listing.watch();
  }

  start(): Promise<boolean> {
    return this.#listing.change((session) => this.#live.api.record(session));
  }

  end(recording: string): Promise<boolean> {
    return this.#listing.change((session) => this.#live.api.endRecording(session, recording));
  }

  remove(recording: string): Promise<boolean> {
    return this.#listing.change((session) => this.#live.api.deleteRecording(session, recording));
  }
}
