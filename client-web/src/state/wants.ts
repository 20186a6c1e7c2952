// What the loop wants of the server while it holds a lease, asked for once at a time: the session's parameters, and the
// clay for its copy.

import type { HandState } from "../protocol/hand_module";
import type { HandAnswer, HandQuestion } from "../protocol/operate";
import type { ToHand } from "../hand/port";

/** From question to question, ms: an answer may itself be old by the time that it comes. */
const AGAIN_MS = 100;
/** A question without an answer is asked again. Clay takes its time. */
const PARAMETERS_LOST_MS = 1000;
const SNAPSHOT_LOST_MS = 10_000;
const SNAPSHOT_AGAIN_MS = 1000;

interface Coming {
  readonly clay: string;
  readonly messages: number;
  readonly bricks: ArrayBuffer[];
}

/** Kinds of binary messages, in their fourth byte, of a snapshot: bricks, and classes of material before them. */
const SNAPSHOT_KINDS: ReadonlySet<number | undefined> = new Set([2, 5]);

export class Wants {
  readonly #ask: (question: HandQuestion) => void;
  readonly #port: { post(message: Extract<ToHand, { type: "parameters" | "snapshot" }>): void };
  readonly #report: (text: string) => void;
  /** Earliest times of the next questions. */
  #parameters_ms = -Infinity;
  #snapshot_ms = -Infinity;
  #now_ms = -Infinity;
  /** The want that was asked for last; a loop that has not looked at the answer yet still has it. */
  #asked: number | undefined;
  #coming: Coming | undefined;
  #said: string | undefined;

  constructor(
    ask: (question: HandQuestion) => void,
    port: { post(message: Extract<ToHand, { type: "parameters" | "snapshot" }>): void },
    report: (text: string) => void,
  ) {
    this.#ask = ask;
    this.#port = port;
    this.#report = report;
  }

  look({ parameters, snapshot }: HandState["wanted"], now_ms: number): void {
    this.#now_ms = now_ms;
    if (parameters && this.#parameters_ms <= now_ms) {
      this.#parameters_ms = now_ms + PARAMETERS_LOST_MS;
      this.#ask({ type: "parameters" });
    }
    if (snapshot === undefined || (snapshot.number === this.#asked && now_ms < this.#snapshot_ms)) return;
    this.#asked = snapshot.number;
    this.#snapshot_ms = now_ms + SNAPSHOT_LOST_MS;
    this.#coming = undefined;
    this.#ask({ type: "snapshot", epoch: snapshot.epoch });
  }

  onAnswer(answer: Extract<HandAnswer, { type: "parameters" | "snapshot" }>): void {
    if (answer.type === "parameters") {
      this.#parameters_ms = this.#now_ms + AGAIN_MS;
      this.#port.post({ type: "parameters", json: answer.json });
      return;
    }
    // Not asked for, or asked for before the line broke.
    if (this.#asked === undefined) return;
    this.#coming = { clay: answer.clay, messages: answer.messages, bricks: [] };
    this.#finish();
  }

  onBinary(bytes: ArrayBuffer): void {
    if (this.#coming === undefined || bytes.byteLength < 4 || !SNAPSHOT_KINDS.has(new Uint8Array(bytes)[3])) return;
    this.#coming.bricks.push(bytes);
    this.#finish();
  }

  /** The module did not take what came. */
  onRefused(of: string, says: string): void {
    if (of === "snapshot") this.#snapshot_ms = this.#now_ms + SNAPSHOT_AGAIN_MS;
    if (of === "parameters") this.#parameters_ms = this.#now_ms + PARAMETERS_LOST_MS;
    const text = `the hand did not take ${of === "snapshot" ? "the clay" : of === "parameters" ? "the parameters" : `what was asked (${of})`}: ${says}`;
    if (text !== this.#said) this.#report(text);
    this.#said = text;
  }

  /** Another lease, or none: what was asked under the one before is not answered. */
  startOver(): void {
    this.#parameters_ms = this.#snapshot_ms = -Infinity;
    this.#asked = this.#coming = undefined;
    this.#said = undefined;
  }

  #finish(): void {
    const coming = this.#coming;
    if (coming === undefined || coming.bricks.length < coming.messages) return;
    this.#coming = undefined;
    this.#snapshot_ms = this.#now_ms + SNAPSHOT_AGAIN_MS;
    this.#port.post({ type: "snapshot", description: coming.clay, bricks: coming.bricks });
  }
}
