// What page and server say to each other about one tool: from the wish to hold it to the last word.
//
//   out ── begin ──> asking ── granted ──> in ── silence, broken line ──> again ── granted ──> in
//    ^                 │ refused            │ farewell                      │ refused for good
//    └─────────────────┴────────────────────┴───────────────────────────────┘         leave: leaving ──> out
//
// The loop outlives its lease: under another one it goes on where that is of the same loop, and otherwise comes to rest
// before it begins anew. Whatever is granted, nothing moves until the hand takes hold.

import type { FromHand, ToHand } from "../hand/port";
import type { HandDevice, HandState } from "../protocol/hand_module";
import {
  decodeHandAnswer, type DeviceDescription, encodeHandQuestion, type Grant, HAND_SUBSCRIPTION, type HandQuestion,
} from "../protocol/operate";
import type { Platform } from "./platform";
import { Wants } from "./wants";

/** The worker, as the page has it. */
export interface HandPort {
  /** Opens the hand's own socket to a session's stream; the one before is closed. */
  connect(session: string): void;
  post(message: Exclude<ToHand, { type: "connect" }>): void;
  end(): void;
}

/** Why the page holds no tool any more, or none yet. */
export type Because =
  | { readonly kind: "refused"; readonly code: string; readonly reason: string; readonly holder: string | undefined }
  | { readonly kind: "farewell"; readonly reason: string }
  | { readonly kind: "trouble"; readonly reason: string };

export type Standing =
  | { readonly name: "out"; readonly because: Because | undefined }
  | { readonly name: "asking" }
  | { readonly name: "in"; readonly tool: number; readonly node: string; readonly lease_s: number }
  /** The lease or the line is lost; another one is asked for. */
  | { readonly name: "again"; readonly tool: number; readonly because: string; readonly attempts: number }
  | { readonly name: "leaving" };

export interface Operator {
  readonly session: string;
  readonly name: string;
  readonly device: DeviceDescription;
  /** Handle motion per motion of the pointer. */
  readonly motion: number;
}

export interface ConversationListener {
  onStanding(standing: Standing): void;
  /** There is a loop that knows no settings yet. */
  onBegun(): void;
  /** Something was not taken, and it goes on all the same. */
  onTrouble(text: string): void;
}

/** An answer that takes longer is none. */
const ANSWER_MS = 5000;
/** First pause before a lease is asked for again; it doubles up to the longest. */
const FIRST_PAUSE_MS = 250;
const LONGEST_PAUSE_MS = 4000;
/** Who has not come back by then is somewhere else: a tool that nobody holds is for others. */
const GIVE_UP_MS = 120_000;
/** A brake takes a fraction of this; a worker that does not tell is not waited for. */
const REST_MS = 500;
const LEAVE_MS = 1000;
/**
 * What a worker told before it heard of its new lease comes within this; and a server that is there is heard by then.
 */
const SETTLE_MS = 2000;
/** A first join is tried so often where the server is busy. */
const MOST_TRIES = 8;
/** What says no for now. Under a lost lease the tool itself is held by it for a while. */
const PASSING: readonly string[] = ["busy", "no_tick_time", "no_free_tool", "reserved", "shutting_down", "no_such_session"];

export class Conversation {
  readonly #platform: Platform;
  readonly #port: HandPort;
  readonly #listener: ConversationListener;
  readonly #wants: Wants;
  #standing: Standing = { name: "out", because: undefined };
  #operator: Operator | undefined;
  #isOpen = false;
  #hasLoop = false;
  #hasEnded = false;
  /** Goes on to the module once the loop that was there is at rest. */
  #anew: Grant | undefined;
  #last: Grant | undefined;
  /** A join is under way: whichever lease it brings is the one that counts. */
  #isJoining = false;
  /** The loop has been heard from under its lease. */
  #isSettled = false;
  #granted_ms = 0;
  #lost_ms = 0;
  #tries = 0;
  #cancel: () => void = () => undefined;

  constructor(platform: Platform, port: HandPort, listener: ConversationListener) {
    this.#platform = platform;
    this.#port = port;
    this.#listener = listener;
    this.#wants = new Wants((question) => this.#ask(question), port, (text) => listener.onTrouble(text));
  }

  /** Asks for a tool. A loop that was held before goes on, where the server lets it. */
  begin(operator: Operator): void {
    if (this.#standing.name !== "out" || this.#hasEnded) return;
    this.#operator = operator;
    this.#tries = 0;
    this.#stand({ name: "asking" });
    this.#join();
  }

  /** Gives the tool back; a worker that is to serve again is another one. */
  leave(): void {
    if (this.#hasEnded || this.#standing.name === "leaving") return;
    const isHeld = this.#standing.name === "in";
    if (!isHeld && !this.#isOpen) {
      this.#end(this.#standing.name === "out" ? this.#standing.because : undefined);
      return;
    }
    this.#stand({ name: "leaving" });
    if (isHeld) {
      this.#port.post({ type: "leave" });
      this.#after(REST_MS, () => this.#sayGoodbye());
    } else {
      // Also where a grant is on its way.
      this.#sayGoodbye();
    }
  }

  /** What the worker tells. */
  take(message: FromHand): void {
    if (this.#hasEnded) return;
    switch (message.type) {
      case "open":
        this.#isOpen = true;
        this.#port.post({ type: "text", text: HAND_SUBSCRIPTION });
        if (this.#standing.name === "asking" || this.#standing.name === "again") this.#sendJoin();
        break;
      case "text": this.#onText(message.text); break;
      case "binary": this.#wants.onBinary(message.bytes); break;
      case "closed": this.#onClosed(message.reason === "" ? "the line to the server broke" : message.reason); break;
      case "state": this.#onState(message.state); break;
      case "refused": this.#onRefused(message.of, message.says); break;
      case "limited": break;
      case "trouble": this.#end({ kind: "trouble", reason: message.says }); break;
    }
  }

  #onText(text: string): void {
    let answer;
    try {
      answer = decodeHandAnswer(text);
    } catch (error) {
      const says = error instanceof Error ? error.message : String(error);
      this.#leaveFor({ kind: "trouble", reason: `the server's answer was not understood: ${says}` });
      return;
    }
    switch (answer.type) {
      case "granted": this.#onGranted(answer.grant); break;
      case "refused": this.#onSaidNo({ kind: "refused", ...answer.refusal }); break;
      case "problem":
        if (this.#standing.name === "asking") this.#leaveFor({ kind: "trouble", reason: answer.detail });
        break;
      case "farewell":
        // By then this end may have left.
        if (this.#standing.name !== "leaving") this.#leaveFor({ kind: "farewell", reason: answer.reason });
        break;
      case "left":
        if (this.#standing.name === "leaving") this.#end(undefined);
        break;
      case "parameters": case "snapshot": this.#wants.onAnswer(answer); break;
      case "other": break;
    }
  }

  #onGranted(grant: Grant): void {
    const { name } = this.#standing;
    if (name !== "asking" && name !== "again" && !(name === "in" && this.#isJoining)) return;
    this.#isJoining = this.#isSettled = false;
    this.#granted_ms = this.#platform.now_ms();
    this.#last = grant;
    this.#wants.startOver();
    if (this.#hasLoop) this.#port.post({ type: "renew", keys: grant.keys.buffer, granted: grant.json });
    else this.#beginLoop(grant);
    // Who held before the silence has to want it anew.
    this.#port.post({ type: "release" });
    this.#stand({ name: "in", tool: grant.tool, node: grant.node, lease_s: grant.lease_s });
  }

  #beginLoop(grant: Grant): void {
    if (this.#operator === undefined) return;
    this.#hasLoop = true;
    const device: HandDevice = { rate_hz: this.#operator.device.rate_hz, motion: this.#operator.motion };
    this.#port.post({ type: "begin", keys: grant.keys.buffer, granted: grant.json, device });
    this.#listener.onBegun();
  }

  #onSaidNo(because: Extract<Because, { kind: "refused" }>): void {
    const { name } = this.#standing;
    this.#isJoining = false;
    if (name !== "asking" && name !== "again") return;
    const mayPass = name === "again" ? PASSING.includes(because.code) : because.code === "busy";
    if (mayPass) this.#askLater(because.reason);
    else this.#leaveFor(because);
  }

  #onClosed(because: string): void {
    this.#isOpen = this.#isJoining = false;
    this.#wants.startOver();
    switch (this.#standing.name) {
      case "asking": this.#leaveFor({ kind: "trouble", reason: because }); break;
      case "in": case "again": this.#askLater(because); break;
      case "leaving": this.#end(undefined); break;
      case "out": break;
    }
  }

  #onState(state: HandState): void {
    const now_ms = this.#platform.now_ms();
    if (this.#anew !== undefined && state.mode === "resting") this.#beginAnew();
    switch (this.#standing.name) {
      case "in":
        this.#isSettled ||= !state.wanted.lease;
        if (!state.wanted.lease) this.#wants.look(state.wanted, now_ms);
        else if (this.#isSettled || SETTLE_MS < now_ms - this.#granted_ms) this.#askLater(`nothing was heard from the server for ${state.silence_s.toFixed(1)} s`);
        break;
      case "leaving":
        if (state.mode === "resting") this.#sayGoodbye();
        break;
      case "again":
        // The line was silent and never broke, and the lease has outlived that.
        if (this.#isOpen && !state.wanted.lease) this.#goOn();
        break;
      case "out": case "asking": break;
    }
  }

  #goOn(): void {
    if (this.#last === undefined) return;
    const { tool, node, lease_s } = this.#last;
    this.#stand({ name: "in", tool, node, lease_s });
  }

  #onRefused(of: Extract<FromHand, { type: "refused" }>["of"], says: string): void {
    if (of === "renew" && this.#last !== undefined) {
      // Another loop, or one that has come to rest: this one rests first, and then there is a new one.
      this.#anew = this.#last;
      this.#port.post({ type: "leave" });
      this.#after(REST_MS, () => this.#beginAnew());
    } else if (of === "begin") {
      this.#ask({ type: "leave" });
      this.#hasLoop = false;
      this.#leaveFor({ kind: "trouble", reason: says });
    } else {
      this.#wants.onRefused(of, says);
    }
  }

  #beginAnew(): void {
    const grant = this.#anew;
    this.#anew = undefined;
    this.#cancel();
    if (grant !== undefined) this.#beginLoop(grant);
  }

  /** The lease or the line is lost, or another was not to be had: in a while. */
  #askLater(because: string): void {
    const now_ms = this.#platform.now_ms();
    const standing = this.#standing;
    const attempts = standing.name === "again" ? standing.attempts + 1 : 0;
    if (standing.name === "asking") {
      this.#tries += 1;
      if (MOST_TRIES <= this.#tries) this.#leaveFor({ kind: "trouble", reason: because });
      else this.#after(FIRST_PAUSE_MS * this.#tries, () => this.#join());
      return;
    }
    if (standing.name === "in") this.#lost_ms = now_ms;
    if (standing.name !== "in" && standing.name !== "again") return;
    if (GIVE_UP_MS < now_ms - this.#lost_ms) {
      this.#leaveFor({ kind: "trouble", reason: `no lease was to be had for two minutes: ${because}` });
      return;
    }
    this.#port.post({ type: "release" });
    this.#stand({ name: "again", tool: standing.tool, because, attempts });
    const longest = Math.min(FIRST_PAUSE_MS * 2 ** attempts, LONGEST_PAUSE_MS);
    this.#after(longest * (0.5 + this.#platform.random() / 2), () => this.#join());
  }

  #join(): void {
    if (this.#isOpen) {
      this.#sendJoin();
      return;
    }
    if (this.#operator !== undefined) this.#port.connect(this.#operator.session);
    this.#after(ANSWER_MS, () => this.#onNoAnswer());
  }

  #sendJoin(): void {
    if (this.#operator === undefined) return;
    const { name, device } = this.#operator;
    this.#isJoining = true;
    this.#ask({ type: "join", operator: name, device });
    this.#after(ANSWER_MS, () => this.#onNoAnswer());
  }

  #onNoAnswer(): void {
    const reason = "the server did not answer";
    // A socket that says nothing is not asked again.
    this.#isOpen = this.#isJoining = false;
    if (this.#standing.name === "asking") this.#leaveFor({ kind: "trouble", reason });
    else this.#askLater(reason);
  }

  #sayGoodbye(): void {
    this.#ask({ type: "leave" });
    this.#after(LEAVE_MS, () => this.#end(undefined));
  }

  #ask(question: HandQuestion): void {
    if (this.#isOpen) this.#port.post({ type: "text", text: encodeHandQuestion(question) });
  }

  /** The lease is over, the loop stays: what it has cut and the server has not yet goes with the next lease. */
  #leaveFor(because: Because): void {
    this.#cancel();
    this.#anew = undefined;
    this.#isOpen = this.#isJoining = false;
    this.#wants.startOver();
    this.#port.post({ type: "release" });
    this.#port.post({ type: "disconnect" });
    if (this.#hasLoop) this.#stand({ name: "out", because });
    else this.#end(because);
  }

  #end(because: Because | undefined): void {
    this.#cancel();
    this.#hasEnded = true;
    this.#port.end();
    this.#stand({ name: "out", because });
  }

  /** One thing is waited for at a time. */
  #after(delay_ms: number, run: () => void): void {
    this.#cancel();
    this.#cancel = this.#platform.after(delay_ms, run);
  }

  #stand(standing: Standing): void {
    if (standing.name !== "asking" && standing.name !== "again" && standing.name !== "leaving") this.#cancel();
    this.#standing = standing;
    this.#listener.onStanding(standing);
  }

  /** Whether there is a worker that can be asked again. */
  get hasEnded(): boolean {
    return this.#hasEnded;
  }
}
