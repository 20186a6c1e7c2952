// A person takes the tool in the browser, at the real server: real input, a bad line, a page that stalls, two pages and
// a hand of its own kind in one clay, a stop.

import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import { HandAgain } from "./hand_again";
import { recordHands, type Recording, recordingOf, type Wake } from "./hand_recorder";
import type { Teleclay } from "./processes";
import { until } from "./until";
import { launch, WatchedPage } from "./watched_page";

/** 150 ms each way, a third of that as jitter, every tenth frame lost. */
const LINE = { delay_s: 0.15, jitter_s: 0.045, loss: 0.1 };
const DRAG_S = 10;

const opened = benchAt("#/live?session=carving&picture=plain", "nobody");
let teleclay: Teleclay;
let page: WatchedPage;
let recording: Recording;
beforeAll(async () => {
  ({ teleclay, page } = opened());
  await teleclay.create({ id: "carving", scheme: "replica", tools: 3, network: { up: LINE, down: LINE } });
  // The same without a network.
  await teleclay.create({ id: "beside", scheme: "replica", tools: 3 });
  await recordHands(page.page.context());
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
    const [began_ms, from_ms] = [performance.now(), Date.now()];
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
    const to_ms = Date.now();
    await page.page.mouse.up();
    await grasp(page, "released");
    recording = await recordingOf(page.page);
    expect((await clay()).removed_units).toBeGreaterThan(before);
    // By the loop's own count; how often a page that draws in software can be asked says nothing of it.
    const wakes = recording.wakes.filter(({ at_ms }) => from_ms < at_ms && at_ms <= to_ms);
    const ticks = wakes.slice(1).reduce((sum, wake) => sum + wake.ticks, 0);
    const mean = (1000 * ticks) / (wakes[wakes.length - 1].at_ms - wakes[0].at_ms);
    process.stdout.write(`loop: ${mean.toFixed(1)} ticks/s on average over ${ticks} ticks; the page told ${Math.min(...paces)} to ${Math.max(...paces)}, ${paces.length} times\n`);
    expect(ticks).toBeGreaterThan(0.95 * 1000 * DRAG_S);
    expect(Math.abs(mean - 1000)).toBeLessThan(20);
    expect(paces.length).toBeGreaterThan(0);
    await page.keep("carving");
  });

  it("has the server's very clay once everything has come", async () => {
    await until("both clays are equal", async () => {
      const [shown] = (await page.text("clay-hash")).split(/\s/);
      return shown === (await clay()).hash;
    });
    await page.saying("clay-verdict", "same");
  });

  it("felt what the same hand feels without a network", async () => {
    const again = await HandAgain.play(teleclay.url, "beside", recording);
    try {
      await again.drain(async () => again.clay_hash === (await teleclay.session("beside")).clay.hash);
      const error = nrmse(recording.wakes, again.wakes);
      const felt_n = greatest(recording.wakes);
      const ticks = recording.wakes.reduce((sum, wake) => sum + wake.ticks, 0);
      process.stdout.write(`felt: ${(100 * error).toFixed(3)} % apart over ${ticks} ticks, up to ${felt_n.toFixed(2)} N; ` +
        `clay ${again.clay_hash === (await clay()).hash ? "the same" : "another"}; round trips ${roundTrip(recording.wakes).toFixed(0)} and ${roundTrip(again.wakes).toFixed(1)} ms\n`);
      expect(again.wakes.slice(0, recording.wakes.length).map(({ ticks }) => ticks)).toEqual(recording.wakes.map(({ ticks }) => ticks));
      expect(felt_n).toBeGreaterThan(0.1);
      // One hand had a network, and the other none; of frames that overtake one another the newest counts, so that the
      // round trip is shorter than twice the mean.
      expect(roundTrip(recording.wakes) - roundTrip(again.wakes)).toBeGreaterThan(50);
      expect(error).toBeLessThan(0.01);
    } finally {
      again.end();
    }
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

type Felt = Pick<Wake, "felt_force_n" | "round_trip_s" | "ticks">;
const norm = ({ felt_force_n }: Felt): number => Math.hypot(...felt_force_n);
const greatest = (wakes: readonly Felt[]): number => wakes.reduce((most, wake) => Math.max(most, norm(wake)), 0);

/** Root mean square of the difference, of the greatest of what is the measure; where either is felt. */
function nrmse(of: readonly Felt[], against: readonly Felt[]): number {
  const squares = of.flatMap((wake, n) => {
    const other = against[n];
    const apart_n = wake.felt_force_n.map((force, axis) => force - other.felt_force_n[axis]);
    return 0 < norm(wake) + norm(other) ? [apart_n.reduce((sum, part) => sum + part * part, 0)] : [];
  });
  return Math.sqrt(squares.reduce((sum, square) => sum + square, 0) / squares.length) / greatest(against);
}

/** The one in the middle, ms. */
function roundTrip(wakes: readonly Felt[]): number {
  const known = wakes.map(({ round_trip_s }) => 1000 * round_trip_s).filter(Number.isFinite).sort((a, b) => a - b);
  return known[known.length >> 1] ?? Number.NaN;
}
