// A recorded hand once more, at a session of its own: the page's own module, told the same at the same times, on a line
// that is as good as this machine's.

import WebSocket from "ws";
import { builtHand } from "../src/protocol/built_hand";
import { type HandModule, isFrames } from "../src/protocol/hand_module";
import { decodeHandAnswer, encodeHandQuestion, type Grant, HAND_SUBSCRIPTION, type HandQuestion } from "../src/protocol/operate";
import { SUBPROTOCOL } from "../src/protocol/text";
import { Wants } from "../src/state/wants";
import type { Call, Recording, Wake } from "./hand_recorder";
import { until } from "./until";

/** Rows of a recording without a time of their own: they belong to the wake before them. */
const UNTIMED = ["hold", "release", "clutch", "lock_axes", "set_motion", "leave"];

export class HandAgain {
  readonly #socket: WebSocket;
  readonly #module: HandModule;
  readonly #wants: Wants;
  readonly #calls: readonly Call[];
  #at = 0;
  /** From the recording's time to that of this process, ms. */
  #shift_ms = Number.NaN;
  #now_ms = 0;
  readonly wakes: Pick<Wake, "felt_force_n" | "round_trip_s" | "ticks">[] = [];
  #trouble: string | undefined;

  private constructor(socket: WebSocket, module: HandModule, calls: readonly Call[]) {
    this.#socket = socket;
    this.#module = module;
    this.#calls = calls;
    this.#wants = new Wants((question) => this.#ask(question), {
      post: (message) => {
        if (message.type === "parameters") module.takeParameters(message.json);
        else module.takeSnapshot(message.description, message.bricks);
      },
    }, (text) => { this.#trouble = text; });
  }

  /** Has all of the recording once more, in the time that it took. */
  static async play(url: string, session: string, { calls }: Recording): Promise<HandAgain> {
    const strange = calls.find(([name]) => name === "renew" || name === "lose_peer");
    if (strange !== undefined) throw new Error(`the recorded hand lost its line: ${strange.join(" ")}`);
    const first = calls.findIndex(([name]) => name === "begin");
    if (first === -1) throw new Error("nobody was granted a tool while it was recorded");
    const module = await builtHand();
    const socket = new WebSocket(`${url.replace(/^http/, "ws")}/api/v1/sessions/${session}/stream`, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    const again = new HandAgain(socket, module, calls.slice(first));
    await again.#begin();
    await again.#goOn();
    return again;
  }

  /** Of the copy of the clay. */
  get clay_hash(): string | undefined {
    return this.#module.look()?.clay_hash;
  }

  /** Goes on without a hand until `isOver`. */
  async drain(isOver: () => Promise<boolean>): Promise<void> {
    await until("the clay is what the copy is", async () => {
      this.#advance(performance.now() - this.#shift_ms);
      return isOver();
    });
  }

  end(): void {
    this.#socket.terminate();
  }

  async #begin(): Promise<void> {
    let grant: Grant | undefined;
    this.#socket.on("error", ({ message }) => { this.#trouble = message; });
    this.#socket.on("open", () => {
      this.#socket.send(HAND_SUBSCRIPTION);
      const device = { name: "mouse on a page", axes: 2, force_n: 0, rate_hz: this.#calls[0][2], measures_force: false } as const;
      this.#ask({ type: "join", operator: "Ada again", device });
    });
    this.#socket.on("message", (data: ArrayBuffer | Buffer, isBinary: boolean) => {
      if (data instanceof ArrayBuffer && isBinary) {
        if (isFrames(data)) this.#module.hear(this.#time(), data);
        else this.#wants.onBinary(data);
        return;
      }
      const answer = decodeHandAnswer(data instanceof ArrayBuffer ? new TextDecoder().decode(data) : data.toString());
      if (answer.type === "granted") {
        grant = answer.grant;
        const [, began_ms, rate_hz, motion] = this.#calls[0];
        this.#shift_ms = performance.now() - began_ms;
        this.#now_ms = began_ms;
        this.#at = 1;
        this.#module.begin(began_ms, { keys: grant.keys, granted: grant.json }, { rate_hz, motion });
      } else if (answer.type === "parameters" || answer.type === "snapshot") this.#wants.onAnswer(answer);
      else if (answer.type !== "other") this.#trouble = JSON.stringify(answer);
    });
    await until("a tool is granted", () => {
      this.#check();
      return grant !== undefined;
    });
  }

  async #goOn(): Promise<void> {
    while (this.#at < this.#calls.length) {
      this.#check();
      const now_ms = performance.now() - this.#shift_ms;
      for (let call = this.#due(now_ms); call !== undefined; call = this.#due(now_ms)) {
        this.#at += 1;
        this.#carryOut(call);
      }
      await new Promise((resume) => setTimeout(resume, 1));
    }
  }

  /** Throws what went wrong. */
  #check(): void {
    if (this.#trouble !== undefined) throw new Error(this.#trouble);
  }

  #due(now_ms: number): Call | undefined {
    if (this.#calls.length <= this.#at) return undefined;
    const call = this.#calls[this.#at];
    return UNTIMED.includes(call[0]) || call[1] <= now_ms ? call : undefined;
  }

  #carryOut([name, ...numbers]: Call): void {
    const [first, at_ms, x_m, y_m, z_m] = numbers;
    switch (name) {
      case "advance": this.#advance(first); break;
      case "tell": this.#module.tell(first, at_ms, [x_m, y_m, z_m]); break;
      case "hold": this.#module.hold(); break;
      case "release": this.#module.release(); break;
      case "clutch": this.#module.clutch(); break;
      case "leave": this.#module.leave(); break;
      case "set_motion": this.#module.setMotion(first); break;
      case "lock_axes": this.#module.lockAxes([(first & 1) !== 0, (first & 2) !== 0, (first & 4) !== 0]); break;
      default: throw new Error(`nobody expected ${name}`);
    }
  }

  #advance(now_ms: number): void {
    this.#now_ms = now_ms;
    const ticks = this.#module.advance(now_ms);
    const message = this.#module.outgoing();
    if (0 < ticks && message !== undefined) this.#socket.send(message);
    this.#module.tidy();
    const state = this.#module.look();
    if (state === undefined) return;
    this.#wants.look(state.wanted, now_ms);
    if (0 < ticks) this.wakes.push({ felt_force_n: state.felt_force_n, round_trip_s: state.round_trip_s ?? Number.NaN, ticks });
  }

  /** Never before what was told last. */
  #time(): number {
    return Math.max(this.#now_ms, performance.now() - this.#shift_ms);
  }

  #ask(question: HandQuestion): void {
    this.#socket.send(encodeHandQuestion(question));
  }
}
