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
    let [sx, sy, sz, n] = [0, 0, 0, 0];
    for (let corner = 0; corner < 8; corner += 1) {
      const [i, j, k] = [corner & 1, (corner >> 1) & 1, corner >> 2];
      const here = voxels[at + i + ROW * j + LAYER * k] - ISOLEVEL;
      if (i === 0) {
        const t = crossing(here, voxels[at + 1 + ROW * j + LAYER * k] - ISOLEVEL);
        if (t !== undefined) { sx += t; sy += j; sz += k; n += 1; }
      }
      if (j === 0) {
        const t = crossing(here, voxels[at + i + ROW + LAYER * k] - ISOLEVEL);
        if (t !== undefined) { sx += i; sy += t; sz += k; n += 1; }
      }
      if (k === 0) {
        const t = crossing(here, voxels[at + i + ROW * j + LAYER] - ISOLEVEL);
        if (t !== undefined) { sx += i; sy += j; sz += t; n += 1; }
      }
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
    for (let axis = 0; axis < 3; axis += 1) {
      const t = this.#within[axis];
      for (let tap = 0; tap < TAPS; tap += 1) {
        this.#smooth[axis][tap] = (1 - t) * SMOOTH[tap + 1] + t * SMOOTH[tap];
        this.#slope[axis][tap] = (1 - t) * SLOPE[tap + 1] + t * SLOPE[tap];
      }
    }
    const [smoothX, smoothY, smoothZ] = this.#smooth;
    const [slopeX, slopeY, slopeZ] = this.#slope;
    let [gx, gy, gz] = [0, 0, 0];
    for (let k = 0; k < TAPS; k += 1) {
      for (let j = 0; j < TAPS; j += 1) {
        const row = at + ROW * (j - 2) + LAYER * (k - 2) - 2;
        let [smooth, slope] = [0, 0];
        for (let i = 0; i < TAPS; i += 1) {
          smooth += smoothX[i] * voxels[row + i];
          slope += slopeX[i] * voxels[row + i];
        }
        gx += smoothY[j] * smoothZ[k] * slope;
        gy += slopeY[j] * smoothZ[k] * smooth;
        gz += smoothY[j] * slopeZ[k] * smooth;
      }
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

/** Where the line from `a` to `b` passes zero, 0 … 1; nothing when it does not. */
function crossing(a: number, b: number): number | undefined {
  return a < 0 === b < 0 ? undefined : a / (a - b);
}
