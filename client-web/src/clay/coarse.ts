// A brick's occupancy at a quarter of the resolution: what the shading of the clay looks up.

import { BRICK_EDGE } from "../protocol/packing";

/** Coarse voxels along a brick's edge. */
export const COARSE_EDGE = 4;
/** Voxels along a coarse voxel's edge. */
export const COARSENESS = BRICK_EDGE / COARSE_EDGE;

/** Mean occupancy of each 4³ block, x fastest, then y, then z. */
export function coarse(voxels: Uint8Array): Uint8Array<ArrayBuffer> {
  const sums = new Uint16Array(COARSE_EDGE ** 3);
  for (let i = 0; i < voxels.length; i += 1) {
    const [x, y, z] = [(i >> 2) & 3, (i >> 6) & 3, i >> 10];
    sums[x + COARSE_EDGE * (y + COARSE_EDGE * z)] += voxels[i];
  }
  return Uint8Array.from(sums, (sum) => Math.round(sum / COARSENESS ** 3));
}
