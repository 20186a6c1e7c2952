// The worker that makes meshes of the past, seen from the page. It is started when somebody first looks back.

import type { Grid, PastMesh } from "../clay/past_mesh";
import type { FromPastWorker, ToPastWorker } from "../clay/past_worker";

let worker: Worker | undefined;
/** Who waits, in the order in which the worker answers. */
const waiting: ((answer: FromPastWorker) => void)[] = [];

/** The mesh in a file of the server's, whose bytes are the worker's from here on; rejects what is no clay. */
export async function readPast(bytes: ArrayBuffer, grid: Grid): Promise<PastMesh> {
  const answer = await new Promise<FromPastWorker>((resolve) => {
    waiting.push(resolve);
    const message: ToPastWorker = { bytes, ...grid };
    started().postMessage(message, [bytes]);
  });
  if (answer.type === "trouble") throw new Error(answer.says);
  return answer.mesh;
}

function started(): Worker {
  if (worker !== undefined) return worker;
  worker = new Worker(new URL("../clay/past_worker.ts", import.meta.url), { type: "module" });
  worker.onmessage = ({ data }: MessageEvent<FromPastWorker>) => waiting.shift()?.(data);
  // Also when its own file cannot be had.
  worker.onerror = () => {
    worker = undefined;
    for (const answer of waiting.splice(0)) answer({ type: "trouble", says: "the page's worker did not start" });
  };
  return worker;
}
