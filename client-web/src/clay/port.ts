// What crosses between the page and the clay worker: brick messages as they came in, meshes back.

import type { BrickMesh } from "./surface";

/** `half`: voxels of twice the edge, for machines that draw slowly. */
export type Detail = "full" | "half";

export type ToWorker =
  /** Comes first of all, once. */
  | { readonly type: "detail"; readonly detail: Detail }
  | { readonly type: "bricks"; readonly bytes: ArrayBuffer }
  /** A new view: it holds no mesh yet. */
  | { readonly type: "everything" };

export interface MeshedBrick {
  readonly index: number;
  /** Nothing: the brick has no surface. */
  readonly mesh: BrickMesh | undefined;
  /** Mean occupancy of blocks of voxels: see `coarse.ts`. */
  readonly coarse: Uint8Array<ArrayBuffer>;
}

export interface Meshes {
  readonly type: "meshes";
  /** The grid is another one: every mesh held before is void. */
  readonly regridded: boolean;
  readonly epoch: number;
  readonly voxel_size_m: number;
  readonly bricks_per_axis: readonly [number, number, number];
  readonly bricks: readonly MeshedBrick[];
  /** Bricks still to come. */
  readonly stale: number;
  readonly duration_ms: number;
}

export interface Undecodable {
  readonly type: "undecodable";
  readonly reason: string;
}

export type ClayUpdate = Meshes | Undecodable;
