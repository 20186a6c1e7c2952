// The strokes of the session on show, and undo and redo.

import type { ReadonlySignal } from "@preact/signals-core";
import type { Redo, Strokes, Undo } from "../protocol/strokes";
import { decodeStrokes } from "../protocol/text";
import type { Outcome } from "./api";
import type { Live } from "./live";
import { Listing } from "./listing";
import type { Platform } from "./platform";

/** Asked for this long after the last answer while the clay changes, and while it does not, ms. */
const CHANGING_MS = 1000;
const RESTING_MS = 5000;

export class TimeLine {
  readonly #live: Live;
  readonly #listing: Listing<Strokes>;
  /** What the clay was when its strokes were last asked for. */
  #asked = "";

  constructor(platform: Platform, live: Live) {
    this.#live = live;
    this.#listing = new Listing(platform, live, {
      path: (session) => live.api.historyPath(session),
      decode: decodeStrokes,
      missing: "the strokes of this session are not to be had",
      isDue: ({ clay: { epoch, removed_units } }, since_ms) => {
        const clay = `${epoch} ${removed_units}`;
        if (since_ms < (clay === this.#asked ? RESTING_MS : CHANGING_MS)) return false;
        this.#asked = clay;
        return true;
      },
    });
  }

  /** Nothing before the first answer of this session. */
  get strokes(): ReadonlySignal<Strokes | undefined> {
    return this.#listing.found;
  }

  /** Why the last undo or redo was not done, or why there are no strokes. */
  get refusal(): ReadonlySignal<string | undefined> {
    return this.#listing.refusal;
  }

  /** Whether an undo or redo is under way: a second press would be another one. */
  get isBusy(): ReadonlySignal<boolean> {
    return this.#listing.isBusy;
  }

  /** Keeps the strokes new; returns what ends that. */
  watch(): () => void {
    return this.#listing.watch();
  }

  /** Returns whether it was done. */
  undo(which: Undo): Promise<boolean> {
    return this.#change((session) => this.#live.api.undo(session, which));
  }

  redo(which: Redo): Promise<boolean> {
    return this.#change((session) => this.#live.api.redo(session, which));
  }

  #change(ask: (session: string) => Promise<Outcome>): Promise<boolean> {
    return this.#listing.change(ask, (outcome) => this.#live.adopt(outcome));
  }
}
