// Something of the session on show that is asked for while somebody looks at it, and changed at a press.

import { batch, signal, type ReadonlySignal } from "@preact/signals-core";
import type { Session } from "../protocol/session";
import { type Outcome, refusalOf, saidIn } from "./api";
import type { Live } from "./live";
import type { Platform } from "./platform";
import { repeatedly } from "./repeatedly";

/** Looks whether there is something new this often, ms. */
const LOOK_MS = 250;

export interface Listed<T> {
  readonly path: (session: string) => string;
  readonly decode: (text: string) => T;
  /** What is said where nobody answers. */
  readonly missing: string;
  /** Whether it is to be asked for, so long after the last answer, ms; without end before the first of a session. */
  readonly isDue: (session: Session, since_ms: number) => boolean;
}

export class Listing<T> {
  readonly #platform: Platform;
  readonly #live: Live;
  readonly #what: Listed<T>;
  readonly #found = signal<T | undefined>(undefined);
  readonly #refusal = signal<string | undefined>(undefined);
  readonly #isBusy = signal(false);
  #session = "";
  #answered_ms = Number.NEGATIVE_INFINITY;
  /** Counts what was asked, so that what was overtaken is not shown. */
  #turn = 0;

  constructor(platform: Platform, live: Live, what: Listed<T>) {
    this.#platform = platform;
    this.#live = live;
    this.#what = what;
  }

  /** Nothing before the first answer of this session. */
  get found(): ReadonlySignal<T | undefined> {
    return this.#found;
  }

  /** Why the last change was not made, or why there is nothing to show. */
  get refusal(): ReadonlySignal<string | undefined> {
    return this.#refusal;
  }

  /** Whether a change is under way: a second press would be another one. */
  get isBusy(): ReadonlySignal<boolean> {
    return this.#isBusy;
  }

  /** Keeps it new; returns what ends that. */
  watch(): () => void {
    return repeatedly(this.#platform, LOOK_MS, () => this.#look());
  }

  /** Returns whether it was done; `adopt` takes what the server said along with it. */
  async change(ask: (session: string) => Promise<Outcome>, adopt?: (outcome: Outcome) => void): Promise<boolean> {
    const session = this.#live.session.peek();
    if (session === undefined || this.#isBusy.peek()) return false;
    this.#isBusy.value = true;
    const outcome = await ask(session.id);
    batch(() => {
      adopt?.(outcome);
      this.#refusal.value = refusalOf(outcome);
    });
    if (outcome.kind === "done") await this.#ask(session.id);
    this.#isBusy.value = false;
    return outcome.kind === "done";
  }

  async #look(): Promise<void> {
    const session = this.#live.session.peek();
    // A change asks by itself, and is done once it has its answer: a look meanwhile would overtake that.
    if (session === undefined || !this.#live.isCurrent.peek() || this.#isBusy.peek()) return;
    if (session.id !== this.#session) {
      this.#session = session.id;
      this.#answered_ms = Number.NEGATIVE_INFINITY;
      batch(() => {
        this.#found.value = undefined;
        this.#refusal.value = undefined;
      });
    }
    if (this.#what.isDue(session, this.#platform.now_ms() - this.#answered_ms)) await this.#ask(session.id);
  }

  async #ask(session: string): Promise<void> {
    this.#turn += 1;
    const turn = this.#turn;
    const found = await this.#answer(session);
    this.#answered_ms = this.#platform.now_ms();
    if (turn !== this.#turn || session !== this.#live.session.peek()?.id) return;
    batch(() => {
      if ("is" in found) this.#found.value = found.is;
      // A refusal stays beside its button; there is no room for two.
      else if (this.#found.peek() === undefined) this.#refusal.value = found.why;
    });
  }

  async #answer(session: string): Promise<{ readonly is: T } | { readonly why: string }> {
    try {
      const answer = await this.#platform.request("GET", this.#what.path(session));
      return answer.status === 200 ? { is: this.#what.decode(answer.body) } : { why: saidIn(answer).detail };
    } catch {
      return { why: this.#what.missing };
    }
  }
}
