// The worker's work without the worker: what to do with what came, when to wake, what to send and to tell. Clock,
// socket and page are arguments.

import { type HandModule, type HandState, isFrames } from "../protocol/hand_module";
import type { FromHand, Pace, ToHand } from "./port";

/** From wake to wake, ms, at the least: ticks wait for one another, so that there are fewer messages than ticks. */
const WAKES_MS = { precise: 2, timers: 4 } as const;
/** The page is told of the state this often, ms: as often as it draws. */
const STATE_MS = 1000 / 60;
/**
 * More bytes than this do not wait in a socket, 70 ms of frames with cuts: what would leave later is no news, and the
 * next frames say it again.
 */
const MOST_WAITING = 64 * 1024;

/** The socket to the server. */
export interface Line {
  send(message: string | Uint8Array<ArrayBuffer>): void;
  /** Bytes that wait in it. */
  waiting(): number;
  close(): void;
}

export interface World {
  /** Milliseconds since the worker began, and that moment in milliseconds since the epoch. */
  now(): number;
  readonly began_epoch_ms: number;
  readonly how: Pace["how"];
  connect(url: string, subprotocols: readonly string[]): Line;
  post(message: FromHand): void;
}

export class HandLoop {
  readonly #module: HandModule;
  readonly #world: World;
  #line: Line | undefined;
  #told_ms = -Infinity;
  #most_ticks = 0;
  #unsent = 0;
  #limit_n: number | undefined;
  #has_ended = false;

  constructor(module: HandModule, world: World) {
    this.#module = module;
    this.#world = world;
  }

  /** Something came from the page. */
  take(message: ToHand): void {
    if (this.#has_ended) return;
    this.#guarded(message.type, () => {
      this.#carryOut(message);
    });
  }

  onOpen(): void {
    this.#world.post({ type: "open" });
  }

  onText(text: string): void {
    this.#world.post({ type: "text", text });
  }

  onBinary(bytes: ArrayBuffer): void {
    if (this.#has_ended) return;
    if (!isFrames(bytes)) {
      this.#world.post({ type: "binary", bytes });
      return;
    }
    // What is no frame is counted, and nobody needs to be told a thousand times a second.
    this.#guarded("wake", () => {
      this.#module.hear(this.#world.now(), bytes);
    }, () => undefined);
  }

  onClose(code: number, reason: string): void {
    this.#line = undefined;
    if (!this.#has_ended) this.#module.losePeer(this.#world.now());
    this.#world.post({ type: "closed", code, reason });
  }

  /** Makes what is owed. Returns how long to wait until the next wake, ms; nothing when there is no hand any more. */
  wake(): number | undefined {
    if (this.#has_ended) return undefined;
    this.#guarded("wake", () => {
      this.#step(this.#world.now());
    });
    // A failure within has ended it.
    return this.#ended() ? undefined : this.#wait(this.#world.now());
  }

  #ended(): boolean {
    return this.#has_ended;
  }

  #step(now_ms: number): void {
    const ticks = this.#module.advance(now_ms);
    this.#most_ticks = Math.max(this.#most_ticks, ticks);
    const message = this.#module.outgoing();
    if (0 < ticks && message !== undefined) this.#send(message);
    this.#module.tidy();
    const isDue = this.#told_ms + STATE_MS <= now_ms;
    if (!isDue && this.#limit_n === undefined) return;
    const state = this.#module.look();
    if (state === undefined) return;
    this.#letGoAbove(state);
    if (!isDue) return;
    const pace: Pace = { how: this.#world.how, most_ticks: this.#most_ticks, unsent: this.#unsent };
    this.#world.post({ type: "state", state, pace });
    this.#told_ms = now_ms;
    this.#most_ticks = 0;
  }

  /** The page may be busy: a hand that wants to be let go of at some force is, here. */
  #letGoAbove({ grasp, felt_force_n }: HandState): void {
    const felt_n = Math.hypot(...felt_force_n);
    if (this.#limit_n === undefined || grasp !== "held" || felt_n < this.#limit_n) return;
    this.#module.release();
    this.#world.post({ type: "limited", felt_n });
  }

  #send(message: Uint8Array<ArrayBuffer>): void {
    if (this.#line === undefined || MOST_WAITING < this.#line.waiting()) this.#unsent += 1;
    else this.#line.send(message);
  }

  #wait(now_ms: number): number {
    const every_ms = WAKES_MS[this.#world.how];
    // Without a hand nothing is due, and a message from the page is looked at in its turn.
    return Math.min(Math.max(this.#module.due() + every_ms - 1 - now_ms, 0), every_ms);
  }

  #carryOut(message: ToHand): void {
    const module = this.#module;
    const now_ms = this.#world.now();
    switch (message.type) {
      case "connect":
        this.#line?.close();
        this.#line = this.#world.connect(message.url, message.subprotocols);
        break;
      case "disconnect":
        this.#line?.close();
        this.#line = undefined;
        module.losePeer(now_ms);
        break;
      case "text": this.#line?.send(message.text); break;
      case "begin": module.begin(now_ms, { keys: new Uint8Array(message.keys), granted: message.granted }, message.device); break;
      case "renew": module.renew(now_ms, { keys: new Uint8Array(message.keys), granted: message.granted }); break;
      case "parameters": module.takeParameters(message.json); break;
      case "snapshot": module.takeSnapshot(message.description, message.bricks); break;
      case "sample": module.tell(now_ms, message.at_epoch_ms - this.#world.began_epoch_ms, message.position_m); break;
      case "lock": module.lockAxes(message.axes); break;
      case "motion": module.setMotion(message.motion); break;
      case "limit": this.#limit_n = message.felt_n; break;
      case "hold": module.hold(); break;
      case "release": module.release(); break;
      case "clutch": module.clutch(); break;
      case "leave": module.leave(); break;
    }
  }

  /** What the module refuses is said; where it breaks, the hand ends, and the server learns it by the line. */
  #guarded(
    of: ToHand["type"] | "wake",
    work: () => void,
    refused = (says: string): void => this.#world.post({ type: "refused", of, says }),
  ): void {
    try {
      work();
    } catch (error) {
      const says = error instanceof Error ? error.message : String(error);
      if (error instanceof WebAssembly.RuntimeError) this.#end(says);
      else refused(says);
    }
  }

  #end(says: string): void {
    this.#has_ended = true;
    this.#line?.close();
    this.#line = undefined;
    this.#world.post({ type: "trouble", says: `the hand has ended, as its module broke: ${says}` });
  }
}
