// The module of WebAssembly that this page has in common with the server (wasm/src/page.rs): its calls as checked
// types. What crosses is numbers; whatever is longer is copied into the module's memory and out of it. That memory
// moves when it grows, so every buffer is asked for its place after the call that filled it.

import type { Branch, RobotGeometry, Triple } from "./theory";

/** As `Buffer` of the module counts them. */
const Buffer = { bytesIn: 0, numbersIn: 1, numbers: 2, refusal: 3, positions: 4, facing: 5, indices: 6, coarse: 7 } as const;

const DONE = 0;
const REGRIDDED = 1;
const NO_BRICK = 0xffff_ffff;

const SCHEMES = { position_force: 0, force_exchange: 1 } as const;
export type DelayedScheme = keyof typeof SCHEMES;

/** Names of the module's functions, with how many numbers each takes. */
const FUNCTIONS = {
  address: 1, length: 1, resize_bytes_in: 1, resize_numbers_in: 1,
  halve_clay: 0, take_in_bricks: 0, mark_all_bricks: 0, describe_clay: 0, mesh_next_brick: 0,
  set_loop: 0, find_outlook: 2, find_curve: 2, find_arms: 0,
} as const;

type Exports = Readonly<Record<keyof typeof FUNCTIONS, (...numbers: number[]) => number>> & { readonly memory: WebAssembly.Memory };

/** What the module refused, in its own words. */
export class ModuleRefusal extends Error {
  override readonly name = "ModuleRefusal";
}

export interface BrickMesh {
  /** Three per vertex, voxels from the low corner of the grid. */
  readonly positions: Float32Array<ArrayBuffer>;
  /** Four per vertex: the outward normal scaled to 127, and a zero that keeps vertices on four bytes. */
  readonly facing: Int8Array<ArrayBuffer>;
  /** Three per triangle, counter-clockwise seen from the air. */
  readonly indices: Uint16Array<ArrayBuffer>;
}

export interface MeshedBrick {
  readonly index: number;
  /** Nothing: the brick has no surface. */
  readonly mesh: BrickMesh | undefined;
  /** Mean occupancy of blocks of 4³ voxels, x fastest, then y, then z. */
  readonly coarse: Uint8Array<ArrayBuffer>;
}

export interface ClayDescription {
  readonly epoch: number;
  readonly voxel_size_m: number;
  readonly bricks_per_axis: readonly [number, number, number];
  /** Bricks whose surface is out of date. */
  readonly stale: number;
}

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

export class PageModule {
  readonly #exports: Exports;

  /** Throws where the module is not the one that this page was built with. */
  constructor({ exports }: WebAssembly.Instance) {
    for (const name of Object.keys(FUNCTIONS)) {
      if (typeof exports[name] !== "function") throw new TypeError(`the module has no function ${name}`);
    }
    if (!(exports["memory"] instanceof WebAssembly.Memory)) throw new TypeError("the module has no memory");
    this.#exports = exports as unknown as Exports;
  }

  /** Shows clay at half its resolution from here on: a quarter of the triangles. */
  halveClay(): void {
    this.#exports.halve_clay();
  }

  /**
   * Takes a message of bricks in. Returns whether the grid is another one, so that no mesh made before is of any use.
   */
  takeInBricks(message: ArrayBuffer): boolean {
    this.#exports.resize_bytes_in(message.byteLength);
    new Uint8Array(this.#exports.memory.buffer, this.#address(Buffer.bytesIn), message.byteLength).set(new Uint8Array(message));
    return this.#carriedOut(this.#exports.take_in_bricks()) === REGRIDDED;
  }

  /** Calls every brick stale: somebody needs all of the surface. */
  markAllBricks(): void {
    this.#exports.mark_all_bricks();
  }

  describeClay(): ClayDescription {
    this.#exports.describe_clay();
    const [epoch, voxel_size_m, x, y, z, stale] = this.#numbers();
    return { epoch, voxel_size_m, bricks_per_axis: [x, y, z], stale };
  }

  /** Finds the surface of a brick that is stale; nothing when none is. */
  meshNextBrick(): MeshedBrick | undefined {
    const index = this.#exports.mesh_next_brick() >>> 0;
    if (index === NO_BRICK) return undefined;
    const { buffer } = this.#exports.memory;
    const place = (of: number): [ArrayBuffer, number, number] => [buffer, this.#address(of), this.#length(of)];
    const mesh = this.#length(Buffer.indices) === 0 ? undefined : {
      positions: new Float32Array(...place(Buffer.positions)).slice(),
      facing: new Int8Array(...place(Buffer.facing)).slice(),
      indices: new Uint16Array(...place(Buffer.indices)).slice(),
    };
    return { index, mesh, coarse: new Uint8Array(...place(Buffer.coarse)).slice() };
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

  #carriedOut(outcome: number): number {
    if (outcome === DONE || outcome === REGRIDDED) return outcome;
    const words = new Uint8Array(this.#exports.memory.buffer, this.#address(Buffer.refusal), this.#length(Buffer.refusal));
    throw new ModuleRefusal(new TextDecoder().decode(words));
  }

  /** What the last call found; it stands until the next. */
  #numbers(): Float64Array {
    return new Float64Array(this.#exports.memory.buffer, this.#address(Buffer.numbers), this.#length(Buffer.numbers));
  }

  #address(buffer: number): number {
    return this.#exports.address(buffer) >>> 0;
  }

  #length(buffer: number): number {
    return this.#exports.length(buffer) >>> 0;
  }
}

/** The module out of a file on its way. Throws where it does not come, or the browser does not run it. */
export async function moduleFrom(file: Promise<Response>): Promise<PageModule> {
  const response = await file;
  if (!response.ok) throw new Error(`${response.url} answers ${response.status}`);
  return new PageModule((await WebAssembly.instantiateStreaming(response, {})).instance);
}
