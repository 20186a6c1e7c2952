// What a hand in the browser costs the server beside a handle of its own kind, and what the page costs its reader:
// time until it can be used, how late a cut is in the picture, long tasks, memory. `TELECLAY_MINUTES` says how long
// memory is watched, 10 unless told.

import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import { shownIn, watchPictures } from "./cut_to_picture";
import { recordHands, recordingOf } from "./hand_recorder";
import type { Teleclay } from "./processes";
import { until } from "./until";
import { launch, WatchedPage } from "./watched_page";

const COUNT_S = 20;
const ROUNDS = 3;
const STROKES = 60;
/** From stroke to stroke: many times what a cut takes to be drawn. */
const REST_S = 1.2;
const MINUTES = Number(process.env["TELECLAY_MINUTES"] ?? 10);

const opened = benchAt("#/live?session=costs&picture=plain", "nobody");
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(async () => {
  ({ teleclay, page } = opened());
  await teleclay.create({ id: "costs", scheme: "replica", tools: 2 });
  await page.page.reload();
}, 300_000);

const attribute = (of: WatchedPage, id: string, name: string): Promise<string | null> => of.page.getByTestId(id).getAttribute(name);
const told = (line: string): boolean => process.stdout.write(`${line}\n`);
const quantile = (of: readonly number[], share: number): number => [...of].sort((a, b) => a - b)[Math.floor(share * of.length)] ?? Number.NaN;
const median = (of: readonly number[]): number => quantile(of, 0.5);

async function take(of: WatchedPage): Promise<void> {
  await of.page.getByTestId("operator").fill("Ada");
  await of.page.getByTestId("operate").click();
  await until("the page is in", async () => (await attribute(of, "operating", "data-standing")) === "in");
}

async function middle(of: WatchedPage): Promise<{ x: number; y: number }> {
  const box = await of.page.getByTestId("scene").boundingBox();
  if (box === null) throw new Error("there is no picture");
  return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
}

const removed = async (): Promise<number> => (await teleclay.session("costs")).clay.removed_units;

async function press(of: WatchedPage): Promise<void> {
  await of.page.mouse.down();
  await until("the hand is held", async () => (await attribute(of, "scene", "data-grasp")) === "held");
}

/** Presses in the middle of a fresh block, and goes down until that cuts. */
async function touchDown(of: WatchedPage): Promise<{ x: number; y: number }> {
  await teleclay.ask("sessions/costs/clay/reset", {});
  const { x, y } = await middle(of);
  await of.page.mouse.move(x, y);
  await press(of);
  await until("clay is felt", async () => {
    await of.page.mouse.wheel(0, 120);
    return 0 < (await removed());
  });
  return { x, y };
}

/** A hand drags through clay, round and round, until `isOver`. */
async function drag(isOver: () => boolean): Promise<void> {
  const { x, y } = await touchDown(page);
  const began_ms = performance.now();
  while (!isOver()) {
    const t_s = (performance.now() - began_ms) / 1000;
    await page.page.mouse.move(x + 60 * Math.sin(2.4 * t_s), y + 25 * Math.sin(1.1 * t_s));
  }
  await page.page.mouse.up();
}

/** What the server takes of a core, by what it counts itself. */
async function serverShare(meanwhile: (isOver: () => boolean) => Promise<unknown>): Promise<number> {
  const [began_ms, before_s] = [performance.now(), teleclay.serverCpu_s];
  await meanwhile(() => 1000 * COUNT_S < performance.now() - began_ms);
  return (teleclay.serverCpu_s - before_s) / ((performance.now() - began_ms) / 1000);
}

const nothing = async (isOver: () => boolean): Promise<void> => {
  await until("time has passed", isOver, 2 * COUNT_S);
};
const passed = (span_s: number): Promise<void> => {
  const end_ms = performance.now() + 1000 * span_s;
  return nothing(() => end_ms < performance.now());
};

describe("what it costs", () => {
  it("is usable soon", async () => {
    const browser = await launch();
    const times_s: number[] = [];
    for (let n = 0; n < 5; n += 1) {
      const began_ms = performance.now();
      const fresh = await WatchedPage.open(browser, `${teleclay.url}/#/live?session=costs&picture=plain`);
      await fresh.page.getByTestId("operate").click({ trial: true });
      times_s.push((performance.now() - began_ms) / 1000);
      await fresh.page.context().close();
    }
    await browser.close();
    told(`usable: the tool can be asked for ${median(times_s).toFixed(2)} s after the address was entered (${times_s.map((s) => s.toFixed(2)).join(", ")})`);
  });

  it("costs the server as much as another hand, and a half at most", async () => {
    const shares: Record<"idle" | "page" | "handle", number[]> = { idle: [], page: [], handle: [] };
    for (let n = 0; n < ROUNDS; n += 1) {
      shares.idle.push(await serverShare(nothing));
      await take(page);
      shares.page.push(await serverShare(drag));
      await page.page.getByTestId("release").click();
      await until("the tool is free", async () => (await teleclay.session("costs")).tools.every(({ operator }) => operator === ""));
      teleclay.startHandle("--session", "costs", "--intent", "cutting", "--operator", "Hal");
      await until("Hal cuts", async () => (await teleclay.session("costs")).tools.some(({ operator, force_n }) => operator === "Hal" && force_n.some((n) => 0 < Math.abs(n))));
      shares.handle.push(await serverShare(nothing));
      await teleclay.killHandles();
      await until("the tool is free", async () => (await teleclay.session("costs")).tools.every(({ operator }) => operator === ""));
    }
    const [idle, hand, handle] = [median(shares.idle), median(shares.page), median(shares.handle)];
    const all = Object.entries(shares).map(([name, of]) => `${name} ${of.map((share) => (100 * share).toFixed(1)).join(" ")}`).join("; ");
    told(`server: ${(100 * idle).toFixed(1)} % of a core with a watching page alone; a hand in it adds ${(100 * (hand - idle)).toFixed(1)}, a handle ${(100 * (handle - idle)).toFixed(1)}: ratio ${((hand - idle) / (handle - idle)).toFixed(2)} (${all})`);
    expect((hand - idle) / (handle - idle)).toBeLessThan(1.5);
  });

  it("shows a cut soon", async () => {
    const browser = await launch();
    const fresh = await WatchedPage.open(browser, `${teleclay.url}/#/live?session=costs&picture=plain`);
    await watchPictures(fresh.page.context());
    await recordHands(fresh.page.context());
    await fresh.page.reload();
    await take(fresh);
    const { x, y } = await touchDown(fresh);
    await fresh.page.mouse.up();
    const strokes_ms: number[] = [];
    for (let n = 0; n < STROKES; n += 1) {
      // Whatever the stroke before has cut is told and drawn by then.
      await passed(REST_S);
      strokes_ms.push(Date.now());
      await press(fresh);
      await fresh.page.mouse.wheel(0, 40);
      await fresh.page.mouse.move(n % 2 === 0 ? x + 60 : x, y, { steps: 8 });
      await fresh.page.mouse.up();
    }
    await passed(REST_S);
    const shown = await shownIn(fresh.page, await recordingOf(fresh.page), strokes_ms);
    const part = (of: (one: (typeof shown)[number]) => number): string => `${quantile(shown.map(of), 0.5).toFixed(0)}/${quantile(shown.map(of), 0.95).toFixed(0)}`;
    told(`a cut is drawn after, ms, p50/p95 of ${shown.length}: ${part(({ all_ms }) => all_ms)}; of that until told ${part(({ told_ms }) => told_ms)}, ` +
      `until meshed ${part(({ meshed_ms }) => meshed_ms)}, until a frame begins ${part(({ awaited_ms }) => awaited_ms)}, until it is drawn ${part(({ drawn_ms }) => drawn_ms)}`);
    await browser.close();
  });

  it("leaves memory and the page's thread alone", async () => {
    const tasks: number[] = [];
    await page.page.exposeFunction("tellOfATask", (took_ms: number) => tasks.push(took_ms));
    await page.page.evaluate(`new PerformanceObserver((list) => {
      for (const { duration } of list.getEntries()) tellOfATask(duration);
    }).observe({ entryTypes: ["longtask"] })`);
    const cdp = await page.page.context().newCDPSession(page.page);
    await cdp.send("Performance.enable");
    const heap_mb = async (): Promise<number> => {
      await cdp.send("HeapProfiler.collectGarbage");
      const { metrics } = await cdp.send("Performance.getMetrics");
      return (metrics.find(({ name }) => name === "JSHeapUsedSize")?.value ?? Number.NaN) / 1e6;
    };
    await take(page);
    const heaps: number[] = [];
    const began_ms = performance.now();
    for (let n = 0; n < 2 * MINUTES; n += 1) {
      const until_ms = began_ms + 30_000 * (n + 1);
      await drag(() => until_ms < performance.now());
      heaps.push(await heap_mb());
    }
    told(`memory of the page over ${MINUTES} min, MB: ${heaps.map((mb) => mb.toFixed(1)).join(" ")}`);
    told(`tasks over 50 ms: ${tasks.length}, the longest ${Math.max(0, ...tasks).toFixed(0)} ms`);
  });
});
