// The worker that turns brick messages into meshes: the page's own thread only uploads them.

import { decodeBricks } from "../protocol/bricks";
import { BRICK_EDGE } from "../protocol/packing";
import { coarse } from "./coarse";
import { halved } from "./halved";
import { ClayMirror } from "./mirror";
import { Neighbourhood } from "./neighbourhood";
import type { ClayUpdate, Detail, MeshedBrick, ToWorker } from "./port";
import { SurfaceFinder } from "./surface";

/**
 * Meshes are handed over this often, ms, so that a whole new block appears piece by piece and messages get their turn.
 */
const SLICE_MS = 12;
/** After a slice, ms. Two cores are just enough for a loop: there the worker leaves as much time as it takes. */
const REST_MS = navigator.hardwareConcurrency <= 2 ? SLICE_MS : 0;

const mirror = new ClayMirror();
const around = new Neighbourhood();
const finder = new SurfaceFinder();
let detail: Detail = "full";
let regridded = false;
let working = false;

self.onmessage = ({ data }: MessageEvent<ToWorker>): void => {
  if (data.type === "detail") {
    detail = data.detail;
    return;
  }
  if (data.type === "everything") {
    mirror.markAll();
    regridded = 0 < mirror.voxel_size_m;
  } else takeIn(data.bytes);
  if (working) return;
  working = true;
  continueLater();
};

function takeIn(bytes: ArrayBuffer): void {
  try {
    const message = decodeBricks(bytes);
    regridded = mirror.apply(detail === "half" ? halved(message, mirror) : message) || regridded;
  } catch (error) {
    post({ type: "undecodable", reason: error instanceof Error ? error.message : String(error) });
  }
}

/** Yields once, so that messages already queued are taken in before any of their bricks is meshed. */
function continueLater(): void {
  setTimeout(meshSlice, 0);
}

function meshSlice(): void {
  const started = performance.now();
  const bricks: MeshedBrick[] = [];
  while (performance.now() - started < SLICE_MS) {
    const index = mirror.takeStale();
    if (index === undefined) break;
    const voxels = mirror.voxels(...mirror.coordinates(index));
    bricks.push({ index, mesh: meshBrick(index), coarse: coarse(voxels) });
  }
  if (regridded || 0 < bricks.length) {
    post({
      type: "meshes",
      regridded,
      epoch: mirror.epoch,
      voxel_size_m: mirror.voxel_size_m,
      bricks_per_axis: mirror.perAxis,
      bricks,
      stale: mirror.staleBricks,
      duration_ms: performance.now() - started,
    });
    regridded = false;
  }
  working = 0 < mirror.staleBricks;
  if (working) setTimeout(meshSlice, REST_MS);
}

function meshBrick(index: number): MeshedBrick["mesh"] {
  if (!around.fill(mirror, index)) return undefined;
  const [x, y, z] = mirror.coordinates(index);
  return finder.find(around, [x * BRICK_EDGE, y * BRICK_EDGE, z * BRICK_EDGE], [x === 0, y === 0, z === 0]);
}

function post(update: ClayUpdate): void {
  const owned = update.type !== "meshes" ? [] : update.bricks.flatMap(({ mesh }) =>
    mesh === undefined ? [] : [mesh.positions.buffer, mesh.facing.buffer, mesh.indices.buffer]);
  self.postMessage(update, { transfer: owned });
}
