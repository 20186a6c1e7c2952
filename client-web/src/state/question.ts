// One thing that a page asks the server over and over, as sliders move: the newest question counts, one is under way at
// a time, and the last answer stays on show until there is a better one.

import { signal, type ReadonlySignal } from "@preact/signals-core";
import type { Problem } from "../protocol/session";
import { decodeProblem } from "../protocol/text";
import { unexplained } from "./api";
import type { Platform } from "./platform";

/** What became of a question. `answer` is the newest there is, also to an earlier question. */
export interface Asked<Question, Answer> {
  readonly phase: "idle" | "asking" | "answered" | "refused" | "away";
  readonly answer: Answer | undefined;
  /** What `answer` answers. */
  readonly question: Question | undefined;
  readonly problem: Problem | undefined;
}

export interface QuestionOptions<Answer> {
  readonly path: string;
  /** Throws what is no answer. */
  readonly decode: (text: string) => Answer;
  /** Wishes are gathered this long before the newest is asked, ms. */
  readonly gather_ms?: number;
  readonly patience_ms?: number;
}

export class Question<Q, A> {
  readonly #platform: Platform;
  readonly #options: QuestionOptions<A>;
  readonly #asked = signal<Asked<Q, A>>({ phase: "idle", answer: undefined, question: undefined, problem: undefined });
  #next: { readonly question: Q } | undefined;
  #underWay = false;

  constructor(platform: Platform, options: QuestionOptions<A>) {
    this.#platform = platform;
    this.#options = options;
  }

  get asked(): ReadonlySignal<Asked<Q, A>> {
    return this.#asked;
  }

  ask(question: Q): void {
    this.#next = { question };
    this.#asked.value = { ...this.#asked.peek(), phase: "asking" };
    if (this.#underWay) return;
    this.#underWay = true;
    this.#platform.after(this.#options.gather_ms ?? 0, () => void this.#flush());
  }

  async #flush(): Promise<void> {
    for (let next = this.#takeNext(); next !== undefined; next = this.#takeNext()) {
      const outcome = await this.#outcome(next.question);
      // An answer that was overtaken is still newer than the one on show.
      const phase = this.#isOvertaken() ? "asking" : outcome.phase;
      this.#asked.value = { ...this.#asked.peek(), problem: undefined, ...outcome, phase };
    }
    this.#underWay = false;
  }

  #takeNext(): { readonly question: Q } | undefined {
    const next = this.#next;
    this.#next = undefined;
    return next;
  }

  #isOvertaken(): boolean {
    return this.#next !== undefined;
  }

  async #outcome(question: Q): Promise<Pick<Asked<Q, A>, "phase"> & Partial<Asked<Q, A>>> {
    const { path, decode, patience_ms } = this.#options;
    let answer;
    try {
      answer = await this.#platform.request("POST", path, question, patience_ms);
    } catch {
      return { phase: "away" };
    }
    if (answer.status < 200 || 300 <= answer.status) {
      return { phase: "refused", problem: decodeProblem(answer.body) ?? unexplained(answer.status) };
    }
    try {
      return { phase: "answered", answer: decode(answer.body), question };
    } catch (error) {
      const detail = `the answer is not understood: ${error instanceof Error ? error.message : String(error)}`;
      return { phase: "refused", problem: { ...unexplained(answer.status), detail } };
    }
  }
}
