// The worker that makes a mesh of a surface of the past: for a large block that takes longer than a frame of the page.

import { decodeGlb } from "../protocol/glb";
import { type Grid, pastMeshOf, type PastMesh } from "./past_mesh";

/** A file of the server's, and the grid that its clay lies in. */
export interface ToPastWorker extends Grid {
  readonly bytes: ArrayBuffer;
}

/** One for every file, in their order. */
export type FromPastWorker =
  | { readonly type: "mesh"; readonly mesh: PastMesh }
  /** Why there is none, without a full stop. */
  | { readonly type: "trouble"; readonly says: string };

self.onmessage = ({ data }: MessageEvent<ToPastWorker>): void => {
  try {
    const { bytes, ...grid } = data;
    const mesh = pastMeshOf(decodeGlb(bytes), grid);
    post({ type: "mesh", mesh }, [mesh.positions.buffer, mesh.facing.buffer, mesh.indices.buffer, mesh.coarse.buffer]);
  } catch (error) {
    post({ type: "trouble", says: error instanceof Error ? error.message : String(error) }, []);
  }
};

function post(message: FromPastWorker, owned: Transferable[]): void {
  self.postMessage(message, { transfer: owned });
}
