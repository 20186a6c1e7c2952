// The coarse occupancy that the clay's shading looks up, as a texture over the whole grid.

import * as THREE from "three";
import { COARSE_EDGE } from "../clay/port";

/** A rim of air about the grid, so that nothing beyond it looks like clay. */
const RIM = 1;

/** Mean occupancy of blocks of voxels; air as yet. */
export function occupancyTexture(bricks: readonly [number, number, number]): THREE.Data3DTexture {
  const [width, height, depth] = bricks.map((n) => n * COARSE_EDGE + 2 * RIM);
  const texture = new THREE.Data3DTexture(new Uint8Array(width * height * depth), width, height, depth);
  texture.format = THREE.RedFormat;
  texture.minFilter = THREE.LinearFilter;
  texture.magFilter = THREE.LinearFilter;
  texture.unpackAlignment = 1;
  texture.needsUpdate = true;
  return texture;
}

/** Puts a box of blocks into the texture: its low corner and its extent, in blocks; x fastest, then y, then z. */
export function putOccupancy(
  texture: THREE.Data3DTexture,
  corner: readonly [number, number, number],
  extent: readonly [number, number, number],
  coarse: Uint8Array,
): void {
  const { data, width, height } = texture.image;
  if (data === null) return;
  const [x, y, z] = corner.map((n) => n + RIM);
  const [nx, ny, nz] = extent;
  for (let k = 0; k < nz; k += 1) {
    for (let j = 0; j < ny; j += 1) {
      const row = nx * (j + ny * k);
      data.set(coarse.subarray(row, row + nx), x + width * (y + j + height * (z + k)));
    }
  }
}
