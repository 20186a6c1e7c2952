// How long a cut takes until it is drawn. The cut is the hand's, in its worker, by the hash of its copy of the clay;
// the picture is made of what the server tells of its own clay, and is there when the frame with the last mesh of the
// cut is finished. All times are of one clock, since the epoch.

import type { BrowserContext, Page } from "playwright-core";
import type { Recording } from "./hand_recorder";

/** Moments, ms since the epoch. */
interface Seen {
  /** A message of bricks came to the page's thread. */
  readonly bricks: number[];
  /** Meshes came from the clay's worker. */
  readonly meshes: number[];
  /** A frame: its first command, and when all of it was drawn. */
  readonly frames: { readonly began_ms: number; readonly finished_ms: number }[];
}

/** From the last cut of a stroke to the picture of it, and its parts, one after the other, ms. */
export interface Shown {
  readonly all_ms: number;
  /** To the page: the server's merge, its rhythm of telling, the line, and the wait for the page's thread. */
  readonly told_ms: number;
  /** Until there is a mesh. */
  readonly meshed_ms: number;
  /** Until a frame begins. */
  readonly awaited_ms: number;
  /** Until it is finished. */
  readonly drawn_ms: number;
}

/** Has every page of the context that is loaded from here on note what it is told and what it draws. */
export async function watchPictures(context: BrowserContext): Promise<void> {
  await context.addInitScript(watch);
}

/**
 * For each stroke, which began at one of these moments and ended long before the next; nothing for those that cut
 * nothing.
 */
export async function shownIn(page: Page, { wakes }: Recording, strokes_ms: readonly number[]): Promise<Shown[]> {
  const { bricks, meshes, frames } = await page.evaluate<Seen>("seen");
  const cuts = wakes.flatMap(({ clay, at_ms }, n) => (0 < n && Number.isFinite(wakes[n - 1].clay) && clay !== wakes[n - 1].clay ? [at_ms] : []));
  return strokes_ms.flatMap((from_ms, n) => {
    const to_ms = strokes_ms[n + 1] ?? Number.POSITIVE_INFINITY;
    const lastOf = (moments: readonly number[]): number => moments.filter((ms) => from_ms < ms && ms < to_ms).at(-1) ?? Number.NaN;
    const [cut, told, meshed] = [cuts, bricks, meshes].map(lastOf);
    if (Number.isNaN(cut)) return [];
    const frame = frames.find(({ began_ms }) => meshed < began_ms);
    // A frame that is finished after the next stroke has begun is a slow one, and counts as that.
    if (frame === undefined || told < cut) throw new Error(`a cut was never told, or never drawn: ${JSON.stringify({ cut, told, meshed, frame })}`);
    return [{
      all_ms: frame.finished_ms - cut, told_ms: told - cut, meshed_ms: meshed - told, awaited_ms: frame.began_ms - meshed,
      drawn_ms: frame.finished_ms - frame.began_ms,
    }];
  });
}

/** Runs in the page, before anything of its own. */
function watch(): void {
  const seen: Seen = { bricks: [], meshes: [], frames: [] };
  Object.assign(window, { seen });
  const now = (): number => performance.timeOrigin + performance.now();

  const BRICKS = 2;
  window.WebSocket = class extends WebSocket {
    constructor(url: string | URL, subprotocols?: string | string[]) {
      super(url, subprotocols);
      this.addEventListener("message", ({ data }: MessageEvent<unknown>) => {
        if (data instanceof ArrayBuffer && new Uint8Array(data)[3] === BRICKS) seen.bricks.push(now());
      });
    }
  };
  window.Worker = class extends Worker {
    constructor(url: string | URL, options?: WorkerOptions) {
      super(url, options);
      this.addEventListener("message", ({ data }: MessageEvent<{ type?: string; bricks?: readonly unknown[] }>) => {
        if (data.type === "meshes" && 0 < (data.bricks?.length ?? 0)) seen.meshes.push(now());
      });
    }
  };

  const LOOK_EVERY_MS = 1;
  let isDrawing = false;
  const await_ = (context: WebGL2RenderingContext, began_ms: number): void => {
    const fence = context.fenceSync(context.SYNC_GPU_COMMANDS_COMPLETE, 0);
    context.flush();
    const look = (): void => {
      if (fence === null || context.getSyncParameter(fence, context.SYNC_STATUS) === context.SIGNALED) {
        context.deleteSync(fence);
        seen.frames.push({ began_ms, finished_ms: now() });
      } else setTimeout(look, LOOK_EVERY_MS);
    };
    setTimeout(look, 0);
  };
  const draw: (this: WebGL2RenderingContext, mode: number, count: number, type: number, offset: number) => void =
    Reflect.get(WebGL2RenderingContext.prototype, "drawElements");
  WebGL2RenderingContext.prototype.drawElements = function (this: WebGL2RenderingContext, ...what: [number, number, number, number]): void {
    if (!isDrawing) {
      isDrawing = true;
      const began_ms = now();
      // All commands of a frame are given in one go.
      queueMicrotask(() => {
        isDrawing = false;
        await_(this, began_ms);
      });
    }
    draw.apply(this, what);
  };
}
