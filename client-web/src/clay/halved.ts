// Clay at half the resolution: a quarter of the triangles, for machines whose processor draws. Eight bricks make one.

import type { BricksMessage, BrickUpdate } from "../protocol/bricks";
import { BRICK_EDGE, BRICK_VOXELS } from "../protocol/packing";
import type { ClayMirror } from "./mirror";

const HALF_EDGE = BRICK_EDGE / 2;

/** What `message` says, in voxels of twice the edge. `mirror` holds what came before, at that resolution. */
export function halved(message: BricksMessage, mirror: ClayMirror): BricksMessage {
  const [nx, ny, nz] = message.bricks_per_axis;
  const perAxis = [Math.ceil(nx / 2), Math.ceil(ny / 2), Math.ceil(nz / 2)] as const;
  const voxel_size_m = 2 * message.voxel_size_m;
  const anew = message.keyframe || mirror.voxel_size_m !== voxel_size_m || perAxis.some((n, axis) => n !== mirror.perAxis[axis]);
  const coarse = new Map<number, Uint8Array>();
  for (const { index, content } of message.bricks) {
    const [x, y, z] = [index % nx, Math.floor(index / nx) % ny, Math.floor(index / (nx * ny))];
    const [cx, cy, cz] = [x >> 1, y >> 1, z >> 1];
    const at = cx + perAxis[0] * (cy + perAxis[1] * cz);
    let voxels = coarse.get(at);
    if (voxels === undefined) {
      voxels = anew ? new Uint8Array(BRICK_VOXELS) : mirror.voxels(cx, cy, cz).slice();
      coarse.set(at, voxels);
    }
    put(voxels, content, HALF_EDGE * ((x & 1) + BRICK_EDGE * ((y & 1) + BRICK_EDGE * (z & 1))));
  }
  const bricks = Array.from(coarse, ([index, voxels]): BrickUpdate => ({ index, content: simplest(voxels) }));
  return { ...message, bricks_per_axis: perAxis, voxel_size_m, bricks };
}

/** Writes the means of a brick's blocks of 2³ voxels into an eighth of a coarse brick that begins at `corner`. */
function put(voxels: Uint8Array, content: BrickUpdate["content"], corner: number): void {
  for (let z = 0; z < HALF_EDGE; z += 1) {
    for (let y = 0; y < HALF_EDGE; y += 1) {
      const row = corner + BRICK_EDGE * (y + BRICK_EDGE * z);
      for (let x = 0; x < HALF_EDGE; x += 1) {
        voxels[row + x] = content === "empty" ? 0 : content === "full" ? 255 : mean(content, 2 * (x + BRICK_EDGE * (y + BRICK_EDGE * z)));
      }
    }
  }
}

function mean(voxels: Uint8Array, corner: number): number {
  let sum = 0;
  for (const z of [0, BRICK_EDGE * BRICK_EDGE]) {
    for (const y of [0, BRICK_EDGE]) sum += voxels[corner + y + z] + voxels[corner + y + z + 1];
  }
  return Math.round(sum / 8);
}

/** A uniform brick by its word: those share their memory, and cost no search for a surface. */
function simplest(voxels: Uint8Array): BrickUpdate["content"] {
  const level = voxels[0];
  if ((level !== 0 && level !== 255) || voxels.some((voxel) => voxel !== level)) return voxels;
  return level === 0 ? "empty" : "full";
}
