// The module of WebAssembly that takes bricks and makes meshes of them (wasm/src/page.rs): its calls as checked types.

import { type Calls, callsOf, instanceFrom, ModuleRefusal, refusalIn } from "./instance";

/** As `Buffer` of the module counts them. */
const Buffer = { bytesIn: 0, numbers: 1, refusal: 2, positions: 3, facing: 4, indices: 5, coarse: 6 } as const;

const DONE = 0;
const REGRIDDED = 1;
const NO_BRICK = 0xffff_ffff;

/** Names of the module's functions, with how many numbers each takes. */
const FUNCTIONS = {
  address: 1, length: 1, resize_bytes_in: 1,
  halve_clay: 0, take_in_bricks: 0, mark_all_bricks: 0, describe_clay: 0, mesh_next_brick: 0,
} as const;

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

export class PageModule {
  readonly #exports: Calls<keyof typeof FUNCTIONS>;

  /** Throws where the module is not the one that this page was built with. */
  constructor(instance: WebAssembly.Instance) {
    this.#exports = callsOf(instance, FUNCTIONS);
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

  #carriedOut(outcome: number): number {
    if (outcome === DONE || outcome === REGRIDDED) return outcome;
    throw new ModuleRefusal(refusalIn(this.#exports, Buffer.refusal));
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
  return new PageModule(await instanceFrom(file));
}
