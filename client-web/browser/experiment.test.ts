// The Experiment page against the real server: Fig. 7 as a run through the clay, and as the running session gives it.

import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import { benchAt, expectNear, numberIn } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/** Voxels of half a millimetre under a blade: measured within this share of the theory. */
const THROUGH_CLAY = 0.02;

/** A session in real time: some ticks come late, and what is read is a mean over a third of a range. */
const LIVE = 0.05;

const opened = benchAt("#/experiment?picture=plain", []);
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(() => {
  ({ teleclay, page } = opened());
});

describe("the Experiment page", () => {
  it("shows a run of the paper's experiment at once, unasked: each plateau is where f_h / (B + ρ B_i) says", async () => {
    await page.page.getByTestId("cutting-done").waitFor();
    expect(await page.page.locator(".experiment").getAttribute("data-asked")).toBe("answered");
    const clay = await clayOfRanges();
    expect(clay).toEqual([20, 40, 60]);
    const rows = await plateaus();
    expect(rows.map(({ clay: own }) => own)).toEqual(clay);
    for (const [n, { theory, measured, deviation }] of rows.entries()) {
      const want = await closedForm(clay[n]);
      // The page shows three places.
      expect(theory).toBeCloseTo(want, 3);
      expectNear(`plateau ${n + 1}, cm/s`, measured, want, THROUGH_CLAY);
      expect(deviation).toBeCloseTo(100 * (measured / theory - 1), 1);
    }
  });

  it("draws what it tables: the trace, as a file, stands still at the theory's level in each range", async () => {
    const downloading = page.page.waitForEvent("download");
    await page.page.getByTestId("trace-csv").click();
    const [head, ...lines] = readFileSync(await (await downloading).path(), "utf8").trim().split("\r\n");
    expect(head).toBe("t_s,position_m,velocity_m_s,hand_force_n,tool_force_n");
    const trace = lines.map((line) => line.split(",").map(Number));
    expect(trace.length).toBeGreaterThan(1000);
    for (const [n, clay] of (await clayOfRanges()).entries()) {
      // The last third of a range: the blade has forgotten how it came in.
      const [from, to] = [0.05 + 0.03 * n, 0.06 + 0.03 * n];
      const speeds = trace.filter(([, x]) => from <= x && x < to - 0.001).map(([, , v]) => 100 * v);
      expect(speeds.length).toBeGreaterThan(20);
      const want = await closedForm(clay);
      expectNear(`slowest in range ${n + 1}, cm/s`, Math.min(...speeds), want, THROUGH_CLAY);
      expectNear(`fastest in range ${n + 1}, cm/s`, Math.max(...speeds), want, THROUGH_CLAY);
    }
    expect(await page.inked("fig7", "--tool")).toBeGreaterThan(100);
  });

  it("follows other settings: theory at once, measurement on the next run", async () => {
    await page.set("position_ratio", "0.5");
    await page.set("hand_force_n", "3");
    await page.page.getByText("The measurement belongs to other settings").waitFor();
    await until("the theory's marks stand where these settings put them", async () => {
      const { zero_px, unit_px } = await page.figure("fig7");
      for (const [n, clay] of (await clayOfRanges()).entries()) {
        // The middle of 3–6, 6–9, 9–12 cm.
        const [x, y] = [zero_px.x + unit_px.x * (4.5 + 3 * n), zero_px.y - unit_px.y * (await closedForm(clay))];
        if ((await page.inkedAt("fig7", "--text", { x, y, radius: 7 })) < 20) return false;
      }
      return true;
    });
    await run();
    expect(await page.page.getByText("The measurement belongs to other settings").count()).toBe(0);
    const clay = await clayOfRanges();
    for (const [n, { theory, measured }] of (await plateaus()).entries()) {
      // ρ = 1/2: 3 N / (10 + B_i / 2).
      expect(theory).toBeCloseTo(300 / (10 + clay[n] / 2), 3);
      expect(theory).toBeCloseTo(await closedForm(clay[n]), 3);
      expectNear(`plateau ${n + 1}, cm/s`, measured, theory, THROUGH_CLAY);
    }
    await page.page.getByRole("button", { name: "The paper's" }).click();
    await run();
  });

  it("refuses what is no experiment, where it is typed", async () => {
    const edge = page.page.getByTestId("edge-1");
    await edge.fill("99");
    await edge.press("Enter");
    await until("the edge is refused", async () => (await edge.getAttribute("aria-invalid")) === "true");
    expect(await page.page.locator("td", { has: edge }).getByRole("alert").innerText()).toBe("99 cm is not below 9 cm, the next edge");
    expect(await edge.inputValue()).toBe("6");
    await page.set("hand_force_n", "-1");
    await page.saying("hand_force_n", "−1 N is not from 0.001 to 100 N");
    expect(await page.shown("hand_force_n")).toBe("2");
  });

  it("follows the running session, whatever that cuts", async () => {
    await page.choose("fig7-source", "live");
    await page.saying("live-standing", "Session demo");
    await until("the session's curve is drawn", async () => 30 < (await page.inked("fig7", "--hand")));
    const before = await page.canvas("fig7");
    await until("the curve moves", async () => 0.0005 < (await page.share(before, await page.canvas("fig7"))));
    const { material, position_ratio } = await teleclay.session();
    expect(numberIn(await page.text("live-viscosity"))).toBeCloseTo(material.viscosity_pa_s_per_m / 1000, 1);
    expect(position_ratio).toBe(1);
  });

  it("is Fig. 7 live where a hand pushes evenly through the stepped block", async () => {
    await page.page.getByTestId("open-experiment").click();
    await page.saying("live-standing", "Session fig7");
    await page.saying("passages", "3.0–6.0");
    const { clay: { shape }, tool } = await teleclay.session("fig7");
    expect([shape.kind, tool.kind]).toEqual(["stepped", "blade"]);
    teleclay.startHandle("--session", "fig7", "--intent", "sensor-force", "--force-n", "2,0,0");
    const rows = await until("the hand has passed every range", async () => {
      const now = await passages();
      return now.length === 3 && now.every(({ measured }) => Number.isFinite(measured)) ? now : undefined;
    });
    await page.keep("experiment-live");
    for (const [n, { clay, force, theory, measured }] of rows.entries()) {
      // 1, 2, 3 cm of a blade 1 cm wide at 2e5 N·s/m³.
      expectNear(`clay of range ${n + 1}`, clay, 20 * (n + 1), 0.02);
      expectNear(`force in range ${n + 1}`, force, 2, LIVE);
      expectNear(`theory of range ${n + 1}`, theory, (100 * force) / (10 + clay), 0.01);
      expectNear(`plateau ${n + 1} of the session, cm/s`, measured, theory, LIVE);
    }
    await page.choose("fig7-source", "run");
    await until("the session's curve is gone", async () => (await page.inked("fig7", "--hand")) === 0);
  });

  it("fits desk and telephone, light and dark", async () => {
    expect(await page.fit("experiment")).toEqual([]);
  });

  it("gives the browser nothing to complain about", () => {
    expect(page.complaints).toEqual([]);
  });
});

async function run(): Promise<void> {
  await page.page.getByTestId("run").click();
  await page.page.getByTestId("cutting-done").waitFor();
  await until("the run is over", async () => (await page.page.locator(".experiment").getAttribute("data-asked")) === "answered");
}

/** `v = f_h / (B + ρ B_i)`, cm/s, from what the page's own fields show. */
async function closedForm(clay_n_s_per_m: number): Promise<number> {
  const [force, damping, a_h1, a_h2] = await Promise.all(
    ["hand_force_n", "virtual_damping_n_s_per_m", "position_ratio", "force_ratio"].map(async (name) => Number(await page.shown(name))));
  return (100 * force) / (damping + (a_h1 / a_h2) * clay_n_s_per_m);
}

/** The clay of each range, as it stands in the page's table of settings. */
async function clayOfRanges(): Promise<number[]> {
  const fields = await page.page.locator('[data-testid^="clay-"]').all();
  return Promise.all(fields.map(async (field) => Number(await field.inputValue())));
}

interface Plateau {
  readonly clay: number;
  readonly theory: number;
  readonly measured: number;
  /** Per cent. */
  readonly deviation: number;
}

async function plateaus(): Promise<Plateau[]> {
  const rows = await page.page.getByTestId("plateaus").locator("tr").all();
  return Promise.all(rows.map(async (row) => {
    const [clay, , theory, measured, deviation] = (await row.locator("td").allInnerTexts()).map(numberIn);
    return { clay, theory, measured, deviation };
  }));
}

interface Passed {
  readonly clay: number;
  readonly force: number;
  readonly theory: number;
  readonly measured: number;
}

async function passages(): Promise<Passed[]> {
  const rows = await page.page.getByTestId("passages").locator("tr").all();
  return Promise.all(rows.map(async (row) => {
    const [clay, , force, theory, measured] = (await row.locator("td").allInnerTexts()).map(numberIn);
    return { clay, force, theory, measured };
  }));
}
