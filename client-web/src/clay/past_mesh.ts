// A surface of the past, made ready to be drawn as the present one is: in voxels, with normals, and with the coarse
// occupancy that the clay's shading looks up.

import type { Surface } from "../protocol/glb";
import { COARSENESS, COARSE_EDGE } from "./port";

/** Voxels along the edge of a brick. */
const BRICK_EDGE = COARSENESS * COARSE_EDGE;

/** The grid that the clay lies in. */
export interface Grid {
  readonly voxel_size_m: number;
  readonly bricks_per_axis: readonly [number, number, number];
}

export interface PastMesh extends Grid {
  /** Three per vertex, voxels. */
  readonly positions: Float32Array<ArrayBuffer>;
  /** Four per vertex: the outward normal scaled to 127, and a zero that keeps vertices on four bytes. */
  readonly facing: Int8Array<ArrayBuffer>;
  readonly indices: Uint32Array<ArrayBuffer>;
  /** Mean occupancy of blocks of 4³ voxels of the whole grid, x fastest, then y, then z. */
  readonly coarse: Uint8Array<ArrayBuffer>;
}

/** The grid of a block of this size. */
export function gridOf(size_m: readonly [number, number, number], voxel_size_m: number): Grid {
  // A millionth of a voxel is what the division's rounding may add, as the server has it.
  const bricks = (length_m: number): number => Math.max(Math.ceil(Math.ceil(length_m / voxel_size_m - 1e-6) / BRICK_EDGE), 1);
  return { voxel_size_m, bricks_per_axis: [bricks(size_m[0]), bricks(size_m[1]), bricks(size_m[2])] };
}

/** `surface` in voxels of the grid; its positions are scaled where they lie. */
export function pastMeshOf({ positions, indices }: Surface, grid: Grid): PastMesh {
  for (let n = 0; n < positions.length; n += 1) positions[n] /= grid.voxel_size_m;
  const [nx, ny, nz] = grid.bricks_per_axis.map((bricks) => bricks * COARSE_EDGE);
  return { ...grid, positions, indices, facing: facingOf(positions, indices), coarse: coarseOf(positions, indices, [nx, ny, nz]) };
}

/** Normals at the vertices: those of the triangles about each, by their areas. */
function facingOf(positions: Float32Array, indices: Uint32Array): Int8Array<ArrayBuffer> {
  const sums = new Float32Array(positions.length);
  for (let n = 0; n < indices.length; n += 3) {
    const [a, b, c] = [3 * indices[n], 3 * indices[n + 1], 3 * indices[n + 2]];
    const [ux, uy, uz] = [positions[b] - positions[a], positions[b + 1] - positions[a + 1], positions[b + 2] - positions[a + 2]];
    const [wx, wy, wz] = [positions[c] - positions[a], positions[c + 1] - positions[a + 1], positions[c + 2] - positions[a + 2]];
    const [x, y, z] = [uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx];
    for (const vertex of [a, b, c]) {
      sums[vertex] += x;
      sums[vertex + 1] += y;
      sums[vertex + 2] += z;
    }
  }
  const facing = new Int8Array((4 * positions.length) / 3);
  for (let n = 0; n < sums.length; n += 3) {
    const length = Math.hypot(sums[n], sums[n + 1], sums[n + 2]) || 1;
    for (let axis = 0; axis < 3; axis += 1) facing[(4 * n) / 3 + axis] = Math.round((127 * sums[n + axis]) / length);
  }
  return facing;
}

/**
 * How much of each cell is clay, 0 … 255. A column of cells holds what lies below the triangles over it that face up,
 * less what lies below those that face down: `V = ∮ z dA_z`, cell by cell. A triangle counts for the column that its
 * centre stands in; longer ones are split.
 */
function coarseOf(positions: Float32Array, indices: Uint32Array, [nx, ny, nz]: readonly [number, number, number]): Uint8Array<ArrayBuffer> {
  const volumes = new Float32Array(nx * ny * nz);
  /** Area that has all of the cells below this one; one more to a column than there are cells. */
  const lids = new Float32Array(nx * ny * (nz + 1));
  const cellOf = (voxels: number, cells: number): number => Math.min(Math.max(Math.floor(voxels / COARSENESS), 0), cells - 1);
  const add = (corners: Triangle, halvings: number): void => {
    const [ax, ay, az, bx, by, bz, cx, cy, cz] = corners;
    if (0 < halvings && isLong(corners)) {
      for (const half of halves(corners)) add(half, halvings - 1);
      return;
    }
    const area = ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) / 2;
    if (area === 0) return;
    const height = Math.min(Math.max((az + bz + cz) / 3 / COARSENESS, 0), nz);
    const below = Math.floor(height);
    const column = cellOf((ax + bx + cx) / 3, nx) + nx * cellOf((ay + by + cy) / 3, ny);
    lids[column + nx * ny * below] += area;
    if (below < nz) volumes[column + nx * ny * below] += area * (height - below);
  };
  for (let n = 0; n < indices.length; n += 3) {
    const [a, b, c] = [3 * indices[n], 3 * indices[n + 1], 3 * indices[n + 2]];
    add([
      positions[a], positions[a + 1], positions[a + 2], positions[b], positions[b + 1], positions[b + 2],
      positions[c], positions[c + 1], positions[c + 2],
    ], MOST_HALVINGS);
  }
  const coarse = new Uint8Array(volumes.length);
  for (let column = 0; column < nx * ny; column += 1) {
    let lid = 0;
    for (let k = nz - 1; 0 <= k; k -= 1) {
      const cell = column + nx * ny * k;
      lid += lids[cell + nx * ny];
      coarse[cell] = Math.round(255 * Math.min(Math.max((volumes[cell] + lid) / COARSENESS ** 2, 0), 1));
    }
  }
  return coarse;
}

/** Three corners, x, y, z each. */
type Triangle = readonly [number, number, number, number, number, number, number, number, number];

/** A surface of voxels has no longer triangles, voxels: only those of another kind are split. */
const LONGEST = 1.5;
/** Enough for a triangle across the largest grid, of 1024 voxels; a bound for one that is no triangle of clay. */
const MOST_HALVINGS = 20;

function isLong([ax, ay, , bx, by, , cx, cy]: Triangle): boolean {
  return LONGEST < Math.max(ax, bx, cx) - Math.min(ax, bx, cx) || LONGEST < Math.max(ay, by, cy) - Math.min(ay, by, cy);
}

/** A triangle in two, across its longest edge as seen from above. */
function halves([ax, ay, az, bx, by, bz, cx, cy, cz]: Triangle): readonly [Triangle, Triangle] {
  const [ab, bc, ca] = [(bx - ax) ** 2 + (by - ay) ** 2, (cx - bx) ** 2 + (cy - by) ** 2, (ax - cx) ** 2 + (ay - cy) ** 2];
  // Turned until the longest edge is the first.
  if (ab < bc && ca <= bc) return halves([bx, by, bz, cx, cy, cz, ax, ay, az]);
  if (ab < ca && bc < ca) return halves([cx, cy, cz, ax, ay, az, bx, by, bz]);
  const [mx, my, mz] = [(ax + bx) / 2, (ay + by) / 2, (az + bz) / 2];
  return [[ax, ay, az, mx, my, mz, cx, cy, cz], [mx, my, mz, bx, by, bz, cx, cy, cz]];
}
