// A person takes the tool in the browser, at the real server: real input, a bad line, a page that stalls, two pages and
// a hand of its own kind in one clay, a stop.

import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import { launch, WatchedPage } from "./watched_page";

/** 150 ms each way, a third of that as jitter, every tenth frame lost. */
const LINE = { delay_s: 0.15, jitter_s: 0.045, loss: 0.1 };
const DRAG_S = 10;

const opened = benchAt("#/live?session=carving&picture=plain", "nobody");
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(async () => {
  ({ teleclay, page } = opened());
  await teleclay.create({ id: "carving", scheme: "replica", tools: 3, network: { up: LINE, down: LINE } });
  await page.page.reload();
}, 300_000);

const attribute = (of: WatchedPage, id: string, name: string): Promise<string | null> => of.page.getByTestId(id).getAttribute(name);
const grasp = (of: WatchedPage, wanted: string): Promise<unknown> => until(`the hand is ${wanted}`, async () => (await attribute(of, "scene", "data-grasp")) === wanted);
const standing = (of: WatchedPage, wanted: string): Promise<unknown> => until(`the page is ${wanted}`, async () => (await attribute(of, "operating", "data-standing")) === wanted);
const clay = async (): Promise<{ removed_units: number; hash: string }> => (await teleclay.session("carving")).clay;

async function take(of: WatchedPage, name: string): Promise<void> {
  await of.page.getByTestId("operator").fill(name);
  await of.page.getByTestId("operate").click();
  await standing(of, "in").catch(async (error: unknown) => {
    throw new Error(await of.text("operating"), { cause: error });
  });
}

describe("a person in the browser", () => {
  it("carves over a bad line for ten seconds, and the loop keeps its pace although the page stalls", async () => {
    await take(page, "Ada");
    expect((await teleclay.session("carving")).tools[0].operator).toBe("Ada");
    const box = await page.page.getByTestId("scene").boundingBox();
    if (box === null) throw new Error("there is no picture");
    const { x, y } = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    // Down into the clay by the wheel, as long as it takes to feel it.
    await page.page.mouse.move(x, y);
    await page.page.mouse.down();
    await grasp(page, "held");
    await until("clay is felt", async () => {
      await page.page.mouse.wheel(0, 120);
      return 0.05 < Math.abs(await page.number("felt-force")) || 0 < (await clay()).removed_units;
    });
    const before = (await clay()).removed_units;
    const stalls = [3, 6];
    const paces: number[] = [];
    const began_ms = performance.now();
    for (let n = 0; performance.now() - began_ms < 1000 * DRAG_S; n += 1) {
      const t_s = (performance.now() - began_ms) / 1000;
      await page.page.mouse.move(x + 60 * Math.sin(2.4 * t_s), y + 25 * Math.sin(1.1 * t_s));
      if (stalls.length !== 0 && stalls[0] < t_s) {
        stalls.shift();
        await page.page.evaluate(() => {
          const end_ms = performance.now() + 300;
          while (performance.now() < end_ms);
        });
      }
      // It has no pace to tell before its first second is over.
      const pace = n % 10 === 9 ? await page.number("loop-rate") : Number.NaN;
      if (Number.isFinite(pace)) paces.push(pace);
    }
    await page.page.mouse.up();
    await grasp(page, "released");
    expect((await clay()).removed_units).toBeGreaterThan(before);
    const mean = paces.reduce((sum, pace) => sum + pace, 0) / paces.length;
    process.stdout.write(`loop: ${mean.toFixed(0)} ticks/s on average, ${Math.min(...paces)} to ${Math.max(...paces)} over ${paces.length} looks\n`);
    expect(paces.length).toBeGreaterThan(15);
    expect(Math.abs(mean - 1000)).toBeLessThan(20);
    await page.keep("carving");
  });

  it("has the server's very clay once everything has come", async () => {
    await until("both clays are equal", async () => {
      const [shown] = (await page.text("clay-hash")).split(/\s/);
      return shown === (await clay()).hash;
    });
    await page.saying("clay-verdict", "same");
  });

  it("shares the clay with another page and a handle, asks for a tool, and hands it over", async () => {
    await teleclay.patch("carving", { network: { up: { delay_s: 0, jitter_s: 0, loss: 0 }, down: { delay_s: 0, jitter_s: 0, loss: 0 } } });
    teleclay.startHandle("--session", "carving", "--intent", "cutting", "--operator", "Hal");
    await until("the handle holds a tool", async () => (await teleclay.session("carving")).tools.some(({ operator }) => operator === "Hal"));
    const browser = await launch();
    try {
      const bob = await WatchedPage.open(browser, `${teleclay.url}/#/live?session=carving&picture=plain`);
      await bob.saying("tool-1", "Ada");
      await take(bob, "Bob");
      await bob.page.close();
    } finally {
      await browser.close();
    }
    // A closed page frees its tool.
    await until("Bob's tool is free", async () => (await teleclay.session("carving")).tools.every(({ operator }) => operator !== "Bob"), 12);
  });

  it("stops everybody, and nothing moves until it is cleared and taken hold of anew", async () => {
    await page.page.getByTestId("stop").click();
    await until("the session is stopped", async () => (await teleclay.session("carving")).state === "stopped");
    await page.saying("situation", /stopped/i);
    expect((await teleclay.session("carving")).tools.every(({ operator }) => operator === "")).toBe(true);
    await page.keep("stopped");
    await page.page.getByTestId("clear-stop").click();
    await until("the stop is cleared", async () => (await teleclay.session("carving")).state !== "stopped");
    const { removed_units } = await clay();
    await take(page, "Ada");
    await grasp(page, "released");
    expect((await clay()).removed_units).toBeGreaterThanOrEqual(removed_units);
  });
});

