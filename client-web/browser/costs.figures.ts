// What a hand in the browser costs the server beside a handle of its own kind, and what the page costs its reader:
// time until it can be used, long tasks, memory. `TELECLAY_MINUTES` says how long memory is watched, 10 unless told.

import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import { launch, WatchedPage } from "./watched_page";

const COUNT_S = 20;
const ROUNDS = 3;
const MINUTES = Number(process.env["TELECLAY_MINUTES"] ?? 10);

const opened = benchAt("#/live?session=costs&picture=plain", "nobody");
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(async () => {
  ({ teleclay, page } = opened());
  await teleclay.create({ id: "costs", scheme: "replica", tools: 2 });
  await page.page.reload();
}, 300_000);

const attribute = (id: string, name: string): Promise<string | null> => page.page.getByTestId(id).getAttribute(name);
const told = (line: string): boolean => process.stdout.write(`${line}\n`);
const median = (of: readonly number[]): number => [...of].sort((a, b) => a - b)[of.length >> 1] ?? Number.NaN;

async function take(): Promise<void> {
  await page.page.getByTestId("operator").fill("Ada");
  await page.page.getByTestId("operate").click();
  await until("the page is in", async () => (await attribute("operating", "data-standing")) === "in");
}

async function middle(): Promise<{ x: number; y: number }> {
  const box = await page.page.getByTestId("scene").boundingBox();
  if (box === null) throw new Error("there is no picture");
  return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
}

/** A hand drags through clay, round and round, until `isOver`. */
async function drag(isOver: () => boolean): Promise<void> {
  await teleclay.ask("sessions/costs/clay/reset", {});
  const { x, y } = await middle();
  await page.page.mouse.move(x, y);
  await page.page.mouse.down();
  await until("the hand is held", async () => (await attribute("scene", "data-grasp")) === "held");
  await until("clay is felt", async () => {
    await page.page.mouse.wheel(0, 120);
    return 0 < (await teleclay.session("costs")).clay.removed_units;
  });
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
      await take();
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
    await take();
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
