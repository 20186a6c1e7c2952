// The module of WebAssembly that is the handle side of the loop (hand/src/hand.rs): its calls as checked types.

import { type Calls, callsOf, instanceFrom, ModuleRefusal, refusalIn } from "./instance";
import type { Triple } from "./theory";

/** As `Buffer` of the module counts them. */
const Buffer = { bytesIn: 0, outgoing: 1, numbers: 2, refusal: 3 } as const;

const DONE = 0;
/** Bytes of the keys before a grant. */
const KEYS = 64;
/** How many numbers a look sees, in the order of hand/src/numbers.rs. */
const NUMBERS = 46;

/** Names of the module's functions, with how many numbers each takes. */
const FUNCTIONS = {
  address: 1, length: 1, resize_bytes_in: 1,
  begin: 3, renew: 1, take_parameters: 0, begin_snapshot: 0, take_in_bricks: 0, finish_snapshot: 0,
  tell: 5, hear: 1, lose_peer: 1, hold: 0, release: 0, clutch: 0, lock_axes: 1, set_motion: 1, leave: 0,
  advance: 1, due: 0, tidy: 0, look: 0,
} as const;

const MODES = ["coupled", "braking", "resting"] as const;
const LINKS = ["live", "not_yet", "silent", "on_copy", "on_stale_copy", "gone", "paused", "fault"] as const;
const GRASPS = ["released", "waiting", "held", "letting_go", "clutched", "stopped"] as const;
const SCHEMES = ["force_exchange", "position_force", "wave", "tdpa", "replica"] as const;
const COPIES = ["none", "live", "stale", "diverged"] as const;

/** What was counted since the hand began. */
export interface HandCounts {
  readonly ticks: number;
  readonly given_up: number;
  /** Gaps after which the hand has to take hold anew. */
  readonly gaps: number;
  /** Ticks in which the device's own law changed what the loop commanded. */
  readonly guarded: number;
  readonly sent: number;
  readonly stale: number;
  readonly unheard: number;
  readonly undecodable: number;
  readonly foreign: number;
  readonly overflowed: number;
}

/** The state of the last tick. */
export interface HandState {
  readonly at_ms: number;
  readonly mode: (typeof MODES)[number];
  readonly link: (typeof LINKS)[number];
  readonly grasp: (typeof GRASPS)[number];
  readonly scheme: (typeof SCHEMES)[number];
  readonly copy: (typeof COPIES)[number];
  /** Where the pointer draws the handle to, and where that is; displacements from home. */
  readonly hand_m: Triple;
  readonly handle_m: Triple;
  /** In the clay's frame. */
  readonly tool_m: Triple;
  readonly felt_force_n: Triple;
  readonly hand_force_n: Triple;
  readonly device_force_n: Triple;
  /** Sixteen hexadecimal digits; nothing where it is not known. */
  readonly clay_hash: string | undefined;
  readonly clay_epoch: number;
  readonly round_trip_s: number | undefined;
  readonly silence_s: number;
  readonly corrections: { readonly count: number; readonly largest_step_n: number; readonly held_n: number };
  readonly counts: HandCounts;
  readonly wanted: {
    readonly parameters: boolean;
    readonly lease: boolean;
    readonly snapshot: { readonly number: number; readonly epoch: number } | undefined;
  };
}

/** A lease as a join grants it, with its keys: the handle's, then the server's. */
export interface HandGrant {
  readonly keys: Uint8Array;
  /** A `granted`, as JSON. */
  readonly granted: string;
}

/** What the pointer is. */
export interface HandDevice {
  /** Slowest rate at which somebody tells where it is. */
  readonly rate_hz: number;
  /** Handle motion per motion of the pointer. */
  readonly motion: number;
}

/** Whether a binary message is one of frames for a handle; what is wrong with it otherwise, the module says. */
export function isFrames(message: ArrayBuffer): boolean {
  const TOOL_FRAMES = 4;
  return 4 <= message.byteLength && new Uint8Array(message)[3] === TOOL_FRAMES;
}

export class HandModule {
  readonly #exports: Calls<keyof typeof FUNCTIONS>;

  /** Throws where the module is not the one that this page was built with. */
  constructor(instance: WebAssembly.Instance) {
    this.#exports = callsOf(instance, FUNCTIONS);
  }

  /** Begins at rest, released. Throws {@link ModuleRefusal}, and whatever was there stays. */
  begin(now_ms: number, { keys, granted }: HandGrant, { rate_hz, motion }: HandDevice): void {
    this.#giveGrant(keys, granted);
    this.#carriedOut(this.#exports.begin(now_ms, rate_hz, motion));
  }

  /** Goes on under another lease of the same loop. Throws {@link ModuleRefusal}, and nothing changes. */
  renew(now_ms: number, { keys, granted }: HandGrant): void {
    this.#giveGrant(keys, granted);
    this.#carriedOut(this.#exports.renew(now_ms));
  }

  takeParameters(json: string): void {
    this.#give(new TextEncoder().encode(json));
    this.#carriedOut(this.#exports.take_parameters());
  }

  /** Takes the clay for the copy: what it is, as in a grant, and every brick. */
  takeSnapshot(description: string, bricks: readonly ArrayBuffer[]): void {
    this.#give(new TextEncoder().encode(description));
    this.#carriedOut(this.#exports.begin_snapshot());
    for (const message of bricks) {
      this.#give(new Uint8Array(message));
      this.#carriedOut(this.#exports.take_in_bricks());
    }
    this.#carriedOut(this.#exports.finish_snapshot());
  }

  tell(now_ms: number, at_ms: number, [x_m, y_m, z_m]: Triple): void {
    this.#exports.tell(now_ms, at_ms, x_m, y_m, z_m);
  }

  /** A message of frames came. Throws {@link ModuleRefusal} where it is none. */
  hear(now_ms: number, message: ArrayBuffer): void {
    this.#give(new Uint8Array(message));
    this.#carriedOut(this.#exports.hear(now_ms));
  }

  losePeer(now_ms: number): void {
    this.#exports.lose_peer(now_ms);
  }

  hold(): void {
    this.#exports.hold();
  }

  release(): void {
    this.#exports.release();
  }

  clutch(): void {
    this.#exports.clutch();
  }

  lockAxes(locked: readonly [boolean, boolean, boolean]): void {
    this.#exports.lock_axes(locked.reduce((bits, is_locked, axis) => bits | (is_locked ? 1 << axis : 0), 0));
  }

  setMotion(motion: number): void {
    this.#carriedOut(this.#exports.set_motion(motion));
  }

  leave(): void {
    this.#exports.leave();
  }

  /** Makes the ticks that are owed; how many they were. */
  advance(now_ms: number): number {
    return this.#exports.advance(now_ms) >>> 0;
  }

  /** The message that the last advance sends, in memory of its own. */
  outgoing(): Uint8Array<ArrayBuffer> | undefined {
    const length = this.#length(Buffer.outgoing);
    if (length === 0) return undefined;
    return new Uint8Array(this.#exports.memory.buffer, this.#address(Buffer.outgoing), length).slice();
  }

  /** When the next tick is due, ms; infinite while there is no hand. */
  due(): number {
    return this.#exports.due();
  }

  /** Does what no tick has time for, once what the ticks send is on its way. */
  tidy(): void {
    this.#exports.tidy();
  }

  /** The state of the last tick; nothing while there is no hand. */
  look(): HandState | undefined {
    this.#exports.look();
    const length = this.#length(Buffer.numbers);
    if (length === 0) return undefined;
    if (length !== NUMBERS) throw new TypeError(`the module sees ${length} numbers, this page reads ${NUMBERS}`);
    return stateOf(new Float64Array(this.#exports.memory.buffer, this.#address(Buffer.numbers), length));
  }

  #giveGrant(keys: Uint8Array, granted: string): void {
    const json = new TextEncoder().encode(granted);
    const bytes = new Uint8Array(KEYS + json.length);
    bytes.set(keys.subarray(0, KEYS));
    bytes.set(json, KEYS);
    this.#give(bytes);
  }

  #give(bytes: Uint8Array): void {
    this.#exports.resize_bytes_in(bytes.length);
    new Uint8Array(this.#exports.memory.buffer, this.#address(Buffer.bytesIn), bytes.length).set(bytes);
  }

  #carriedOut(outcome: number): void {
    if (outcome !== DONE) throw new ModuleRefusal(refusalIn(this.#exports, Buffer.refusal));
  }

  #address(buffer: number): number {
    return this.#exports.address(buffer) >>> 0;
  }

  #length(buffer: number): number {
    return this.#exports.length(buffer) >>> 0;
  }
}

function stateOf(n: Float64Array): HandState {
  const triple = (at: number): Triple => [n[at], n[at + 1], n[at + 2]];
  const known = (at: number): number | undefined => (Number.isNaN(n[at]) ? undefined : n[at]);
  const half = (at: number): string => n[at].toString(16).padStart(8, "0");
  return {
    at_ms: n[0], mode: MODES[n[1]], link: LINKS[n[2]], grasp: GRASPS[n[3]], scheme: SCHEMES[n[4]], copy: COPIES[n[5]],
    hand_m: triple(6), handle_m: triple(9), tool_m: triple(12),
    felt_force_n: triple(15), hand_force_n: triple(18), device_force_n: triple(21),
    clay_hash: known(24) === undefined ? undefined : half(25) + half(24),
    clay_epoch: n[26], round_trip_s: known(27), silence_s: n[28],
    corrections: { count: n[29], largest_step_n: n[30], held_n: n[31] },
    counts: {
      ticks: n[32], given_up: n[33], gaps: n[34], guarded: n[35], sent: n[36], stale: n[37],
      unheard: n[38], undecodable: n[39], foreign: n[40], overflowed: n[41],
    },
    wanted: {
      parameters: n[42] === 1, lease: n[43] === 1,
      snapshot: known(44) === undefined ? undefined : { number: n[44], epoch: n[45] },
    },
  };
}

/** The module out of a file on its way. Throws where it does not come, or the browser does not run it. */
export async function handModuleFrom(file: Promise<Response>): Promise<HandModule> {
  return new HandModule(await instanceFrom(file));
}
