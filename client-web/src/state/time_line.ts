// The strokes of the session on show, asked for while somebody looks at them; and undo and redo.

import { batch, signal, type ReadonlySignal } from "@preact/signals-core";
import type { Redo, Strokes, Undo } from "../protocol/strokes";
import { decodeStrokes } from "../protocol/text";
import { type Outcome, refusalOf, saidIn } from "./api";
import type { Live } from "./live";
import type { Platform } from "./platform";
import { repeatedly } from "./repeatedly";

/** Looks whether there is something new this often, ms. */
const LOOK_MS = 250;
/** Asked for this long after the last answer while the clay changes, and while it does not, ms. */
const CHANGING_MS = 1000;
const RESTING_MS = 5000;

export class TimeLine {
  readonly #platform: Platform;
  readonly #live: Live;
  readonly #strokes = signal<Strokes | undefined>(undefined);
  readonly #refusal = signal<string | undefined>(undefined);
  readonly #isBusy = signal(false);
  /** What the clay was when its strokes were last asked for. */
  #asked = "";
  #session = "";
  #answered_ms = Number.NEGATIVE_INFINITY;
  /** Counts what was asked, so that what was overtaken is not shown. */
  #turn = 0;

  constructor(platform: Platform, live: Live) {
    this.#platform = platform;
    this.#live = live;
  }

  /** Nothing before the first answer of this session. */
  get strokes(): ReadonlySignal<Strokes | undefined> {
    return this.#strokes;
  }

  /** Why the last undo or redo was not done, or why there are no strokes. */
  get refusal(): ReadonlySignal<string | undefined> {
    return this.#refusal;
  }

  /** Whether an undo or redo is under way: a second press would be another one. */
  get isBusy(): ReadonlySignal<boolean> {
    return this.#isBusy;
  }

  /** Keeps the strokes new; returns what ends that. */
  watch(): () => void {
    return repeatedly(this.#platform, LOOK_MS, () => this.#look());
  }

  /** Returns whether it was done. */
  undo(which: Undo): Promise<boolean> {
    return this.#change((session) => this.#live.api.undo(session, which));
  }

  redo(which: Redo): Promise<boolean> {
    return this.#change((session) => this.#live.api.redo(session, which));
  }

  async #change(ask: (session: string) => Promise<Outcome>): Promise<boolean> {
    const session = this.#live.session.peek();
    if (session === undefined || this.#isBusy.peek()) return false;
    this.#isBusy.value = true;
    const outcome = await ask(session.id);
    batch(() => {
      this.#live.adopt(outcome);
      this.#refusal.value = refusalOf(outcome);
    });
    if (outcome.kind === "done") await this.#ask(session.id);
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
        this.#strokes.value = undefined;
        this.#refusal.value = undefined;
      });
    }
    const { epoch, removed_units } = session.clay;
    const clay = `${epoch} ${removed_units}`;
    const wait_ms = clay === this.#asked ? RESTING_MS : CHANGING_MS;
    if (this.#platform.now_ms() - this.#answered_ms < wait_ms) return;
    this.#asked = clay;
    await this.#ask(session.id);
  }

  async #ask(session: string): Promise<void> {
    this.#turn += 1;
    const turn = this.#turn;
    const found = await this.#strokesOf(session);
    this.#answered_ms = this.#platform.now_ms();
    if (turn !== this.#turn || session !== this.#live.session.peek()?.id) return;
    batch(() => {
      if (typeof found !== "string") this.#strokes.value = found;
      // A refusal of undo stays beside its button; there is no room for two.
      else if (this.#strokes.peek() === undefined) this.#refusal.value = found;
    });
  }

  /** The strokes, or why there are none. */
  async #strokesOf(session: string): Promise<Strokes | string> {
    try {
      const answer = await this.#platform.request("GET", this.#live.api.historyPath(session));
      return answer.status === 200 ? decodeStrokes(answer.body) : saidIn(answer).detail;
    } catch {
      return "the strokes of this session are not to be had";
    }
  }
}
