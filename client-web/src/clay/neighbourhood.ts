// A brick with REACH voxels of its neighbours around it, laid out flat, so that the surface never asks whose voxel it
// is.

import { BRICK_EDGE } from "../protocol/packing";
import { type ClayMirror, REACH } from "./mirror";

/** Voxels along one edge of the neighbourhood. */
export const SPAN = BRICK_EDGE + 2 * REACH;
export const ROW = SPAN;
export const LAYER = SPAN * SPAN;
/** The flat index of the brick's own voxel (0, 0, 0). */
export const ORIGIN = REACH * (1 + ROW + LAYER);

/** Reused from brick to brick: the surface is found one brick at a time. */
export class Neighbourhood {
  readonly voxels = new Uint8Array(SPAN ** 3);

  /** Fills in brick `index`. Returns false, without filling, where no surface can pass. */
  fill(mirror: ClayMirror, index: number): boolean {
    const [x, y, z] = mirror.coordinates(index);
    if (!crossable(mirror, x, y, z)) return false;
    for (let dz = -1; dz <= 1; dz += 1) {
      for (let dy = -1; dy <= 1; dy += 1) {
        for (let dx = -1; dx <= 1; dx += 1) this.#copy(mirror.voxels(x + dx, y + dy, z + dz), dx, dy, dz);
      }
    }
    return true;
  }

  #copy(from: Uint8Array, dx: number, dy: number, dz: number): void {
    const [x, y, z] = [part(dx), part(dy), part(dz)];
    for (let k = z.first; k < z.end; k += 1) {
      for (let j = y.first; j < y.end; j += 1) {
        const source = BRICK_EDGE * (j + BRICK_EDGE * k);
        const target = (x.to + REACH) + ROW * (j - y.first + y.to + REACH) + LAYER * (k - z.first + z.to + REACH);
        for (let i = x.first; i < x.end; i += 1) this.voxels[target + i - x.first] = from[source + i];
      }
    }
  }
}

/**
 * Which voxels of a neighbour at offset `d` are taken along an axis, and where they go in the brick's own coordinates.
 */
function part(d: number): { first: number; end: number; to: number } {
  if (d < 0) return { first: BRICK_EDGE - REACH, end: BRICK_EDGE, to: -REACH };
  if (0 < d) return { first: 0, end: REACH, to: BRICK_EDGE };
  return { first: 0, end: BRICK_EDGE, to: 0 };
}

/**
 * Whether any edge this brick owns can cross the surface: edges run from its voxels to the next ones up each axis, and
 * into the air below the grid where the brick is the lowest.
 */
function crossable(mirror: ClayMirror, x: number, y: number, z: number): boolean {
  const own = mirror.voxels(x, y, z);
  const level = own[0];
  if (level !== 0 && level !== 255) return true;
  const around = [
    own,
    mirror.voxels(x + 1, y, z),
    mirror.voxels(x, y + 1, z),
    mirror.voxels(x, y, z + 1),
  ];
  if (x === 0) around.push(mirror.voxels(-1, y, z));
  if (y === 0) around.push(mirror.voxels(x, -1, z));
  if (z === 0) around.push(mirror.voxels(x, y, -1));
  return !around.every((brick) => mirror.isUniform(brick, level));
}
