// This page's copy of the clay, fed with brick updates, and the list of bricks whose surface has to be found again.

import type { BricksMessage, BrickUpdate } from "../protocol/bricks";
import { BRICK_EDGE, BRICK_VOXELS } from "../protocol/packing";

/** How far a brick's surface looks into its neighbours, voxels: see `surface.ts`. */
export const REACH = 3;

/** A grid of 1024³ voxels: what a page can hold, and twice as fine along each axis as any server makes it. */
const MOST_BRICKS = 64 ** 3;

const EMPTY = new Uint8Array(BRICK_VOXELS);
const FULL = new Uint8Array(BRICK_VOXELS).fill(255);

export class ClayMirror {
  epoch = 0;
  voxel_size_m = 0;
  perAxis: readonly [number, number, number] = [0, 0, 0];
  /** One entry per brick; uniform bricks share one of two arrays, so 512³ of solid clay costs nothing. */
  #bricks: Uint8Array[] = [];
  readonly #stale = new Set<number>();

  get staleBricks(): number {
    return this.#stale.size;
  }

  /**
   * Takes an update in. Returns whether the grid itself changed, so that no mesh made before is of any use. Throws when
   * the grid is beyond what a page can hold.
   */
  apply(message: BricksMessage): boolean {
    const count = message.bricks_per_axis.reduce((product, n) => product * n, 1);
    if (MOST_BRICKS < count) throw new RangeError(`a grid of ${count} bricks, this page holds ${MOST_BRICKS}`);
    const regridded =
      message.voxel_size_m !== this.voxel_size_m || message.bricks_per_axis.some((n, i) => n !== this.perAxis[i]);
    if (regridded || message.keyframe) this.#forget(message);
    this.epoch = message.clay_epoch;
    for (const update of message.bricks) this.#replace(update);
    return regridded;
  }

  /** A brick whose surface is out of date, or nothing; it counts as done from here on. */
  takeStale(): number | undefined {
    for (const index of this.#stale) {
      this.#stale.delete(index);
      return index;
    }
    return undefined;
  }

  /** Calls every brick stale: somebody needs all of the surface. */
  markAll(): void {
    for (let i = 0; i < this.#bricks.length; i += 1) this.#stale.add(i);
  }

  coordinates(index: number): [number, number, number] {
    const [nx, ny] = this.perAxis;
    return [index % nx, Math.floor(index / nx) % ny, Math.floor(index / (nx * ny))];
  }

  /** The voxels of the brick at these coordinates; outside the grid there is only air. */
  voxels(x: number, y: number, z: number): Uint8Array {
    const [nx, ny, nz] = this.perAxis;
    if (x < 0 || y < 0 || z < 0 || nx <= x || ny <= y || nz <= z) return EMPTY;
    return this.#bricks[x + nx * (y + ny * z)];
  }

  /**
   * Whether a brick is one of the two uniform ones, at this level. Cheap: a packed brick that happens to be even is
   * not.
   */
  isUniform(brick: Uint8Array, level: 0 | 255): boolean {
    return brick === (level === 0 ? EMPTY : FULL);
  }

  #forget(message: BricksMessage): void {
    this.perAxis = message.bricks_per_axis;
    this.voxel_size_m = message.voxel_size_m;
    const [nx, ny, nz] = this.perAxis;
    this.#bricks = new Array<Uint8Array>(nx * ny * nz).fill(EMPTY);
    this.#stale.clear();
    this.markAll();
  }

  #replace(update: BrickUpdate): void {
    const { index, content } = update;
    if (this.#bricks.length <= index) return;
    const before = this.#bricks[index];
    const after = content === "empty" ? EMPTY : content === "full" ? FULL : content;
    if (before === after) return;
    this.#bricks[index] = after;
    const changed = difference(before, after);
    if (changed !== undefined) this.#markAround(index, changed);
  }

  /** Marks the brick, and each neighbour that sees any of the changed voxels. */
  #markAround(index: number, changed: Box): void {
    const [x, y, z] = this.coordinates(index);
    const [nx, ny, nz] = this.perAxis;
    const low = changed.low.map((n) => (n < REACH ? -1 : 0));
    const high = changed.high.map((n) => (BRICK_EDGE - REACH <= n ? 1 : 0));
    for (let k = Math.max(z + low[2], 0); k <= Math.min(z + high[2], nz - 1); k += 1) {
      for (let j = Math.max(y + low[1], 0); j <= Math.min(y + high[1], ny - 1); j += 1) {
        for (let i = Math.max(x + low[0], 0); i <= Math.min(x + high[0], nx - 1); i += 1) {
          this.#stale.add(i + nx * (j + ny * k));
        }
      }
    }
  }
}

interface Box {
  readonly low: number[];
  readonly high: number[];
}

/** The box around all voxels that differ; nothing when none does. */
function difference(before: Uint8Array, after: Uint8Array): Box | undefined {
  const low = [BRICK_EDGE, BRICK_EDGE, BRICK_EDGE];
  const high = [-1, -1, -1];
  for (let i = 0; i < BRICK_VOXELS; i += 1) {
    if (before[i] === after[i]) continue;
    const at = [i & 15, (i >> 4) & 15, i >> 8];
    for (let axis = 0; axis < 3; axis += 1) {
      low[axis] = Math.min(low[axis], at[axis]);
      high[axis] = Math.max(high[axis], at[axis]);
    }
  }
  return high[0] < 0 ? undefined : { low, high };
}
