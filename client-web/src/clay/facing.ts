// Which way a brick's mesh faces: a cone that holds the normals of all its triangles, and a ball that holds its
// vertices. From where all of it is seen from behind, none of it is seen.

import type { BrickMesh } from "../protocol/module";

export interface Facing {
  readonly centre: readonly [number, number, number];
  readonly radius: number;
  readonly axis: readonly [number, number, number];
  /** Half the cone's opening, rad; π where the triangles face all ways. */
  readonly opening: number;
}

/** As the mesh counts lengths. */
export function facingOf({ positions, indices }: BrickMesh): Facing {
  const sum: [number, number, number] = [0, 0, 0];
  const normal: [number, number, number] = [0, 0, 0];
  for (let i = 0; i < indices.length; i += 3) {
    if (!normalOf(positions, indices, i, normal)) continue;
    for (let axis = 0; axis < 3; axis += 1) sum[axis] += normal[axis];
  }
  const length = Math.hypot(...sum);
  const axis: [number, number, number] = [sum[0] / length, sum[1] / length, sum[2] / length];
  let least = 1;
  for (let i = 0; i < indices.length; i += 3) {
    if (!normalOf(positions, indices, i, normal)) continue;
    least = Math.min(least, normal[0] * axis[0] + normal[1] * axis[1] + normal[2] * axis[2]);
  }
  const { centre, radius } = ballOf(positions);
  // Normals that cancel out have no axis.
  return { centre, radius, axis, opening: Number.isFinite(least) ? Math.acos(Math.max(Math.min(least, 1), -1)) : Math.PI };
}

/** Whether all of a brick is seen from behind by an eye at a place, so that nothing of it is seen. */
export function isTurnedAway({ centre, radius, axis, opening }: Facing, eye: readonly [number, number, number]): boolean {
  const [x, y, z] = [eye[0] - centre[0], eye[1] - centre[1], eye[2] - centre[2]];
  const distance = Math.hypot(x, y, z);
  if (distance <= radius) return false;
  const toEye = Math.acos(Math.max(Math.min((x * axis[0] + y * axis[1] + z * axis[2]) / distance, 1), -1));
  return Math.PI / 2 + Math.asin(radius / distance) < toEye - opening;
}

/** Of the triangle at index `i`, of length 1; whether it has one. */
function normalOf(positions: Float32Array, indices: Uint16Array, i: number, into: [number, number, number]): boolean {
  const [a, b, c] = [3 * indices[i], 3 * indices[i + 1], 3 * indices[i + 2]];
  const [ux, uy, uz] = [positions[b] - positions[a], positions[b + 1] - positions[a + 1], positions[b + 2] - positions[a + 2]];
  const [vx, vy, vz] = [positions[c] - positions[a], positions[c + 1] - positions[a + 1], positions[c + 2] - positions[a + 2]];
  into[0] = uy * vz - uz * vy;
  into[1] = uz * vx - ux * vz;
  into[2] = ux * vy - uy * vx;
  const length = Math.hypot(into[0], into[1], into[2]);
  if (length === 0) return false;
  for (let axis = 0; axis < 3; axis += 1) into[axis] /= length;
  return true;
}

/** A ball around the box around the vertices. */
function ballOf(positions: Float32Array): Pick<Facing, "centre" | "radius"> {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let n = 0; n < positions.length; n += 1) {
    low[n % 3] = Math.min(low[n % 3], positions[n]);
    high[n % 3] = Math.max(high[n % 3], positions[n]);
  }
  return {
    centre: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2],
    radius: Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) / 2,
  };
}
