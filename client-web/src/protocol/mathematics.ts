// The module of WebAssembly that is the mathematics of a loop and of the robot (mathematics/src/calls.rs): its calls as
// checked types.

import { type Calls, callsOf, instanceFrom, ModuleRefusal, refusalIn } from "./instance";
import type { Branch, RobotGeometry, Triple } from "./theory";

/** As `Buffer` of the module counts them. */
const Buffer = { numbersIn: 0, numbers: 1, refusal: 2 } as const;

const DONE = 0;

const SCHEMES = { position_force: 0, force_exchange: 1 } as const;
export type DelayedScheme = keyof typeof SCHEMES;

/** Names of the module's functions, with how many numbers each takes. */
const FUNCTIONS = {
  address: 1, length: 1, resize_numbers_in: 1, set_loop: 0, find_outlook: 2, find_curve: 2, find_arms: 0,
} as const;

/** What a loop does at a round trip; rate, frequency and the gain there are not numbers where nothing grows. */
export interface Outlook {
  readonly peak_gain: number;
  readonly rate_per_s: number;
  readonly frequency_hz: number;
  readonly gain_there: number;
}

/** The loop gain along ascending frequencies. */
export interface GainCurve {
  readonly omega_rad_s: readonly number[];
  readonly re: readonly number[];
  readonly im: readonly number[];
}

/** One arm of the robot. */
export interface Arm {
  /** Along the arm in the base's plane, x and y, of unit length. */
  readonly direction: readonly [number, number];
  readonly shoulder_m: Triple;
  /** Where its rods end on the platform. */
  readonly wrist_m: Triple;
  /** Nothing: the arm does not reach. */
  readonly bend: { readonly joint_rad: number; readonly elbow_m: Triple } | undefined;
}

const NUMBERS_OF_AN_ARM = 13;

export class MathematicsModule {
  readonly #exports: Calls<keyof typeof FUNCTIONS>;

  /** Throws where the module is not the one that this page was built with. */
  constructor(instance: WebAssembly.Instance) {
    this.#exports = callsOf(instance, FUNCTIONS);
  }

  /** Takes the loop that `numbers` describe, as `Theory::set_loop` of the module reads them. */
  setLoop(numbers: readonly number[]): void {
    this.#give(numbers);
    this.#carriedOut(this.#exports.set_loop());
  }

  outlook(scheme: DelayedScheme, round_trip_s: number): Outlook {
    this.#carriedOut(this.#exports.find_outlook(SCHEMES[scheme], round_trip_s));
    const [peak_gain, rate_per_s, frequency_hz, gain_there] = this.#numbers();
    return { peak_gain, rate_per_s, frequency_hz, gain_there };
  }

  curve(scheme: DelayedScheme, round_trip_s: number): GainCurve {
    this.#carriedOut(this.#exports.find_curve(SCHEMES[scheme], round_trip_s));
    const numbers = this.#numbers();
    const length = numbers.length / 3;
    const list = (n: number): number[] => Array.from(numbers.subarray(n * length, (n + 1) * length));
    return { omega_rad_s: list(0), re: list(1), im: list(2) };
  }

  /** The robot's three arms with the platform at a position. */
  arms(geometry: RobotGeometry, position_m: Triple, branch: Branch): Arm[] {
    const { base_radius_m, platform_radius_m, upper_link_m, lower_link_m, arm_angles_deg } = geometry;
    this.#give([base_radius_m, platform_radius_m, upper_link_m, lower_link_m, ...arm_angles_deg, ...position_m, ...branch]);
    this.#carriedOut(this.#exports.find_arms());
    const numbers = this.#numbers();
    return [0, 1, 2].map((j) => {
      const [ex, ey, sx, sy, sz, wx, wy, wz, reaches, joint_rad, bx, by, bz] = numbers.subarray(j * NUMBERS_OF_AN_ARM);
      return {
        direction: [ex, ey], shoulder_m: [sx, sy, sz], wrist_m: [wx, wy, wz],
        bend: reaches === 1 ? { joint_rad, elbow_m: [bx, by, bz] } : undefined,
      };
    });
  }

  #give(numbers: readonly number[]): void {
    this.#exports.resize_numbers_in(numbers.length);
    new Float64Array(this.#exports.memory.buffer, this.#address(Buffer.numbersIn), numbers.length).set(numbers);
  }

  #carriedOut(outcome: number): void {
    if (outcome !== DONE) throw new ModuleRefusal(refusalIn(this.#exports, Buffer.refusal));
  }

  /** What the last call found; it stands until the next. */
  #numbers(): Float64Array {
    return new Float64Array(this.#exports.memory.buffer, this.#exports.address(Buffer.numbers) >>> 0, this.#exports.length(Buffer.numbers) >>> 0);
  }

  #address(buffer: number): number {
    return this.#exports.address(buffer) >>> 0;
  }
}

/** The module out of a file on its way. Throws where it does not come, or the browser does not run it. */
export async function mathematicsFrom(file: Promise<Response>): Promise<MathematicsModule> {
  return new MathematicsModule(await instanceFrom(file));
}
