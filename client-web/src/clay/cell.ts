// One surface vertex: where the surface crosses a cell (eight neighbouring voxel centres) and which way it faces.

import { LAYER, ORIGIN, ROW } from "./neighbourhood";

/** Occupancy halfway between air and clay: 0 … 127 is air, 128 … 255 is clay. */
export const ISOLEVEL = 127.5;

/** Positions are rounded to this part of a voxel, so that bricks which share a vertex agree on it to the last bit. */
const STEPS_PER_VOXEL = 256;

/** The vertex that was found last; reused, because a brick has hundreds. */
export class Cell {
  /** In voxels from the low corner of the brick. */
  readonly position = new Float64Array(3);
  /** Unit length, out of the clay. */
  readonly normal = new Float64Array(3);
  /** Where in its cell the vertex lies, 0 … 1 per axis, in whole steps. */
  readonly #within = new Float64Array(3);
  readonly #smooth = [new Float64Array(TAPS), new Float64Array(TAPS), new Float64Array(TAPS)];
  readonly #slope = [new Float64Array(TAPS), new Float64Array(TAPS), new Float64Array(TAPS)];

  /** The cell whose lowest voxel is (x, y, z) of the brick; it must cross the surface. */
  solve(voxels: Uint8Array, x: number, y: number, z: number): void {
    const at = ORIGIN + x + ROW * y + LAYER * z;
    this.#place(voxels, at, x, y, z);
    this.#face(voxels, at);
  }

  /** Surface nets: the mean of the crossings on the cell's twelve edges. */
  #place(voxels: Uint8Array, at: number, x: number, y: number, z: number): void {
    let sx = 0;
    let sy = 0;
    let sz = 0;
    let n = 0;
    for (let edge = 0; edge < EDGES.length; edge += 3) {
      const corner = EDGES[edge];
      const axis = EDGES[edge + 2];
      const here = voxels[at + CORNER_AT[corner]];
      const there = voxels[at + CORNER_AT[EDGES[edge + 1]]];
      if (ISOLEVEL < here === ISOLEVEL < there) continue;
      const t = (here - ISOLEVEL) / (here - there);
      sx += axis === 0 ? t : corner & 1;
      sy += axis === 1 ? t : (corner >> 1) & 1;
      sz += axis === 2 ? t : corner >> 2;
      n += 1;
    }
    // Rounded before the cell's own place is added: the sum is then exact, whichever brick's coordinates it is in.
    this.#within[0] = Math.round((sx / n) * STEPS_PER_VOXEL) / STEPS_PER_VOXEL;
    this.#within[1] = Math.round((sy / n) * STEPS_PER_VOXEL) / STEPS_PER_VOXEL;
    this.#within[2] = Math.round((sz / n) * STEPS_PER_VOXEL) / STEPS_PER_VOXEL;
    this.position[0] = x + 0.5 + this.#within[0];
    this.position[1] = y + 0.5 + this.#within[1];
    this.position[2] = z + 0.5 + this.#within[2];
  }

  /**
   * The gradient at the vertex, smoothed over five voxels. Occupancy only changes within a voxel of the surface, so a
   * narrower one would show every rounding step as a facet.
   */
  #face(voxels: Uint8Array, at: number): void {
    const [smoothX, smoothY, smoothZ] = this.#smooth;
    const [slopeX, slopeY, slopeZ] = this.#slope;
    for (let axis = 0; axis < 3; axis += 1) slide(this.#within[axis], this.#smooth[axis], this.#slope[axis]);
    // The innermost six are written out: this is where finding a surface spends its time.
    const [s0, s1, s2, s3, s4, s5] = smoothX;
    const [d0, d1, d2, d3, d4, d5] = slopeX;
    let gx = 0;
    let gy = 0;
    let gz = 0;
    for (let k = 0; k < TAPS; k += 1) {
      let alongX = 0;
      let alongY = 0;
      let alongZ = 0;
      for (let j = 0; j < TAPS; j += 1) {
        const row = at + ROW * (j - 2) + LAYER * (k - 2) - 2;
        const v0 = voxels[row];
        const v1 = voxels[row + 1];
        const v2 = voxels[row + 2];
        const v3 = voxels[row + 3];
        const v4 = voxels[row + 4];
        const v5 = voxels[row + 5];
        const smooth = s0 * v0 + s1 * v1 + s2 * v2 + s3 * v3 + s4 * v4 + s5 * v5;
        alongX += smoothY[j] * (d0 * v0 + d1 * v1 + d2 * v2 + d3 * v3 + d4 * v4 + d5 * v5);
        alongY += slopeY[j] * smooth;
        alongZ += smoothY[j] * smooth;
      }
      gx += smoothZ[k] * alongX;
      gy += smoothZ[k] * alongY;
      gz += slopeZ[k] * alongZ;
    }
    const length = Math.hypot(gx, gy, gz);
    const scale = length === 0 ? 0 : -1 / length;
    this.normal[0] = gx * scale;
    this.normal[1] = gy * scale;
    this.normal[2] = length === 0 ? 1 : gz * scale;
  }
}

/** Voxels that the normal looks at along each axis: five about the cell's low corner and five about its high one. */
const TAPS = 6;
/** Binomial smoothing over five voxels and its derivative, with a zero at either end to slide within six. */
const SMOOTH = [0, 1, 4, 6, 4, 1, 0];
const SLOPE = [0, -1, -2, 0, 2, 1, 0];

/** The weights of a place `t` of the way from a cell's low corner to its high one. */
function slide(t: number, smooth: Float64Array, slope: Float64Array): void {
  for (let tap = 0; tap < TAPS; tap += 1) {
    smooth[tap] = (1 - t) * SMOOTH[tap + 1] + t * SMOOTH[tap];
    slope[tap] = (1 - t) * SLOPE[tap + 1] + t * SLOPE[tap];
  }
}

/** A cell's corners, numbered with x in the lowest bit: where they lie from the first. */
const CORNER_AT = [0, 1, ROW, ROW + 1, LAYER, LAYER + 1, LAYER + ROW, LAYER + ROW + 1];

/** A cell's edges: low corner, high corner, axis. */
const EDGES = [
  0, 1, 0, 2, 3, 0, 4, 5, 0, 6, 7, 0,
  0, 2, 1, 1, 3, 1, 4, 6, 1, 5, 7, 1,
  0, 4, 2, 1, 5, 2, 2, 6, 2, 3, 7, 2,
];
