// Every session that the server has, asked for while somebody looks at the list; and what can be done with one.

import { signal, type ReadonlySignal } from "@preact/signals-core";
import type { NewSession, SessionEntry } from "../protocol/session";
import { decodeSessions } from "../protocol/text";
import { API, idsOf } from "./connection";
import { type Outcome, refusalOf, saidIn } from "./api";
import type { Live } from "./live";
import type { Platform } from "./platform";
import { repeatedly } from "./repeatedly";
import { sharing } from "./sharing";

export type SessionsState =
  | { readonly name: "looking" }
  | { readonly name: "known"; readonly entries: readonly SessionEntry[] }
  /** What is known is old, or nothing is; and why. */
  | { readonly name: "away"; readonly entries: readonly SessionEntry[]; readonly because: string };

/** Clay is removed and disks fill while one looks. */
const EVERY_MS = 1000;

export class Sessions {
  readonly #platform: Platform;
  readonly #live: Live;
  readonly #state = signal<SessionsState>({ name: "looking" });
  /** Counts what was asked, so that an answer from before a change does not undo it on the page. */
  #turn = 0;

  constructor(platform: Platform, live: Live) {
    this.#platform = platform;
    this.#live = live;
  }

  get state(): ReadonlySignal<SessionsState> {
    return this.#state;
  }

  get entries(): readonly SessionEntry[] {
    const state = this.#state.value;
    return state.name === "looking" ? [] : state.entries;
  }

  /** Keeps the list new; returns what ends that. */
  watch(): () => void {
    return repeatedly(this.#platform, EVERY_MS, () => this.look());
  }

  async look(): Promise<void> {
    this.#turn += 1;
    const turn = this.#turn;
    const found = await this.#list();
    if (turn !== this.#turn) return;
    if (typeof found === "string") {
      this.#state.value = { name: "away", entries: this.entries, because: found };
      return;
    }
    this.#state.value = sharing(this.#state.peek(), { name: "known", entries: found });
    this.#live.connection.know(idsOf(found));
  }

  /** Returns why it was not done; nothing when it was. */
  create(session: NewSession): Promise<string | undefined> {
    return this.#change(this.#live.api.create(session));
  }

  duplicate(session: string, id: string): Promise<string | undefined> {
    return this.#change(this.#live.api.duplicate(session, id));
  }

  remove(session: string): Promise<string | undefined> {
    return this.#change(this.#live.api.remove(session));
  }

  async #change(asked: Promise<Outcome>): Promise<string | undefined> {
    const outcome = await asked;
    await this.look();
    return refusalOf(outcome);
  }

  /** The sessions, or why there are none to be had. */
  async #list(): Promise<SessionEntry[] | string> {
    let answer;
    try {
      answer = await this.#platform.request("GET", `${API}/sessions`);
    } catch {
      return "the server did not answer";
    }
    if (answer.status !== 200) return saidIn(answer).detail;
    try {
      return decodeSessions(answer.body);
    } catch (error) {
      return `the answer is not understood: ${error instanceof Error ? error.message : String(error)}`;
    }
  }
}
