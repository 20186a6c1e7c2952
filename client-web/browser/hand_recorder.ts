// What the hand's module in a page is told, call by call, and what is felt after each wake: enough to have the very
// same hand once more elsewhere.

import type { BrowserContext, Page } from "playwright-core";
import { fileFor } from "./watched_page";

/** Numbers that JavaScript gives to a function of the module, after its name. */
export type Call = readonly [name: string, ...numbers: number[]];

export interface Wake {
  /** N, on the hand. */
  readonly felt_force_n: readonly number[];
  /** Not a number before the first is known. */
  readonly round_trip_s: number;
  readonly ticks: number;
  /** Changes with every cut; not a number while there is no copy of the clay. */
  readonly clay: number;
  /** Of its last tick, since the epoch. */
  readonly at_ms: number;
}

export interface Recording {
  readonly calls: readonly Call[];
  /** One for each `advance` that made ticks, in their order. */
  readonly wakes: readonly Wake[];
}

const CHANNEL = "recording of the hand";

/** Has every worker that a page of the context starts from here on record what it tells a hand's module. */
export async function recordHands(context: BrowserContext): Promise<void> {
  await context.route(/\/assets\/worker-[^/]*\.js$/, async (route) => {
    const { headers, body } = await fileFor(route);
    await route.fulfill({ headers, body: `(${record.toString()})(${JSON.stringify(CHANNEL)});\n${body.toString()}` });
  });
}

/** What has been recorded so far. */
export async function recordingOf(page: Page): Promise<Recording> {
  return page.evaluate((name) => new Promise<Recording>((resume) => {
    const channel = new BroadcastChannel(name);
    channel.onmessage = ({ data }: MessageEvent<Recording>): void => {
      channel.close();
      resume(data);
    };
    channel.postMessage("tell");
  }), CHANNEL);
}

/** Runs in the worker, before anything of its own. */
function record(name: string): void {
  const KEPT = ["begin", "tell", "hold", "release", "clutch", "lock_axes", "set_motion", "leave", "lose_peer", "renew", "advance"];
  /** As hand/src/numbers.rs has them, and the buffer that they lie in. */
  const [NUMBERS, LENGTH, FELT, CLAY, ROUND_TRIP] = [2, 46, 15, 24, 27];
  const instantiate = WebAssembly.instantiateStreaming;
  WebAssembly.instantiateStreaming = async (source, imports) => {
    const made = await instantiate(source, imports);
    const { exports } = made.instance;
    const call = (which: string, ...numbers: number[]): number => {
      const of = exports[which];
      return typeof of === "function" ? Number(Reflect.apply(of, undefined, numbers)) : Number.NaN;
    };
    const { memory } = exports;
    if (!("advance" in exports) || !(memory instanceof WebAssembly.Memory)) return made;
    const [calls, wakes]: [unknown[], unknown[]] = [[], []];
    const channel = new BroadcastChannel(name);
    channel.onmessage = () => channel.postMessage({ calls, wakes });
    const recorded = Object.fromEntries(KEPT.map((kept) => [kept, (...numbers: number[]) => {
      calls.push([kept, ...numbers]);
      const outcome = call(kept, ...numbers);
      if (kept !== "advance" || outcome === 0) return outcome;
      call("look");
      const seen = new Float64Array(memory.buffer, call("address", NUMBERS), LENGTH);
      wakes.push({
        felt_force_n: [...seen.subarray(FELT, FELT + 3)], round_trip_s: seen[ROUND_TRIP], ticks: outcome, clay: seen[CLAY],
        at_ms: performance.timeOrigin + seen[0],
      });
      return outcome;
    }]));
    return { module: made.module, instance: { exports: { ...exports, ...recorded } } };
  };
}
