// What crosses between the page and the clay worker: brick messages as they came in, meshes back.

import type { ClayDescription, MeshedBrick } from "../protocol/module";

/** Voxels along the edge of a block whose mean occupancy the shading of the clay looks up. */
export const COARSENESS = 4;
/** Such blocks along a brick's edge. */
export const COARSE_EDGE = 4;

/** `half`: voxels of twice the edge, for machines that draw slowly. */
export type Detail = "full" | "half";

export type ToWorker =
  /** Comes first of all, once. */
  | { readonly type: "detail"; readonly detail: Detail }
  | { readonly type: "bricks"; readonly bytes: ArrayBuffer }
  /** A new view: it holds no mesh yet. */
  | { readonly type: "everything" };

export interface Meshes extends ClayDescription {
  readonly type: "meshes";
  /** The grid is another one: every mesh held before is void. */
  readonly regridded: boolean;
  readonly bricks: readonly MeshedBrick[];
  readonly duration_ms: number;
}

export interface Trouble {
  readonly type: "trouble";
  /** A sentence without its full stop. */
  readonly says: string;
}

export type ClayUpdate = Meshes | Trouble;
