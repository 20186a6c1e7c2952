// The worker that turns brick messages into meshes: the module does, and the page's own thread only uploads them.

import address from "../../generated/page.wasm?url";
import { type MeshedBrick, moduleFrom, type PageModule } from "../protocol/module";
import type { ClayUpdate, ToWorker } from "./port";

/**
 * Meshes are handed over this often, ms, so that a whole new block appears piece by piece and messages get their turn.
 */
const SLICE_MS = 12;
/** After a slice, ms. Two cores are just enough for a loop: there the worker leaves as much time as it takes. */
const REST_MS = navigator.hardwareConcurrency <= 2 ? SLICE_MS : 0;

const loading = moduleFrom(fetch(address));
loading.catch((error: unknown) => post({ type: "trouble", says: `the clay cannot be shown, as the page's module did not load: ${reasonOf(error)}` }));
let regridded = false;
let working = false;

// What comes before the module waits for it, in its order.
self.onmessage = ({ data }: MessageEvent<ToWorker>): void => {
  loading.then((module) => take(module, data), () => undefined);
};

function take(module: PageModule, data: ToWorker): void {
  if (data.type === "detail") {
    if (data.detail === "half") module.halveClay();
    return;
  }
  if (data.type === "everything") {
    module.markAllBricks();
    regridded = 0 < module.describeClay().voxel_size_m;
  } else takeIn(module, data.bytes);
  if (working) return;
  working = true;
  // Messages already queued are taken in before any of their bricks is meshed.
  setTimeout(meshSlice, 0, module);
}

function takeIn(module: PageModule, bytes: ArrayBuffer): void {
  try {
    regridded = module.takeInBricks(bytes) || regridded;
  } catch (error) {
    post({ type: "trouble", says: `clay not understood: ${reasonOf(error)}` });
  }
}

function meshSlice(module: PageModule): void {
  const started = performance.now();
  const bricks: MeshedBrick[] = [];
  while (performance.now() - started < SLICE_MS) {
    const brick = module.meshNextBrick();
    if (brick === undefined) break;
    bricks.push(brick);
  }
  const clay = module.describeClay();
  if (regridded || 0 < bricks.length) {
    post({ type: "meshes", ...clay, regridded, bricks, duration_ms: performance.now() - started });
    regridded = false;
  }
  working = 0 < clay.stale;
  if (working) setTimeout(meshSlice, REST_MS, module);
}

function post(update: ClayUpdate): void {
  const owned = update.type !== "meshes" ? [] : update.bricks.flatMap(({ mesh }) =>
    mesh === undefined ? [] : [mesh.positions.buffer, mesh.facing.buffer, mesh.indices.buffer]);
  self.postMessage(update, { transfer: owned });
}

function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
