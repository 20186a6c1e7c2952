// The Latency page against the real server, with a table that the real program makes.

import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import { decodeLatencyTable } from "../src/protocol/text";
import type { LatencyCell, LatencyTable } from "../src/protocol/latency";
import { benchAt, numberIn } from "./bench";
import { makeLatencyTable } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

const opened = benchAt("#/latency?picture=plain", "nobody");
let page: WatchedPage;
let file: string;
let table: LatencyTable;
beforeAll(async () => {
  ({ page } = opened());
  file = await makeLatencyTable();
  table = decodeLatencyTable(readFileSync(file, "utf8"));
}, 300_000);

describe("the Latency page", () => {
  it("shows the table that it was published with, until there is a newer one", async () => {
    await until("a table is shown", async () => (await page.page.locator(".latency").getAttribute("data-table")) === "shown");
    expect(await page.text("origin")).toMatch(/published with this page/);
    expect(await page.page.locator(".heatmap").count()).toBe(5);
  });

  it("is one stop of the tab key per map, and walked by arrows", async () => {
    const map = page.page.getByTestId("map-wave");
    expect(await map.locator('td button[tabindex="0"]').count()).toBe(1);
    await map.locator('td button[tabindex="0"]').focus();
    await page.page.keyboard.press("Home");
    const focused = (): Promise<string | null> => page.page.locator(":focus").getAttribute("data-cell");
    const [scheme, first_s, loss] = ((await focused()) ?? "").split(" ");
    await page.page.keyboard.press("ArrowRight");
    const [, second_s] = ((await focused()) ?? "").split(" ");
    expect(Number(first_s)).toBeLessThan(Number(second_s));
    await page.page.keyboard.press("ArrowDown");
    const [of, delay_s, more] = ((await focused()) ?? "").split(" ");
    expect([of, delay_s]).toEqual([scheme, second_s]);
    expect(Number(loss)).toBeLessThan(Number(more));
    expect(await map.locator('td button[tabindex="0"]').getAttribute("data-cell")).toBe(await focused());
    await page.page.locator("a.brand").focus();
  });

  it("takes a table from a file, and says whose it is", async () => {
    await page.page.getByTestId("table-file").setInputFiles(file);
    await until("the table is shown", async () => (await page.page.locator(".latency").getAttribute("data-table")) === "shown");
    await page.saying("origin", /latency\.json/);
  });

  it("has a map for every scheme of the table, and a cell for every delay and loss", async () => {
    const shown = cellsOf("iid", 0);
    const schemes = [...new Set(shown.map(({ scheme }) => scheme))];
    expect(schemes.toSorted()).toEqual(["force_exchange", "position_force", "replica", "tdpa", "wave"]);
    for (const scheme of schemes) {
      const cells = page.page.getByTestId(`map-${scheme}`).locator("td button");
      expect(await cells.count()).toBe(shown.filter((cell) => cell.scheme === scheme).length);
    }
  });

  it("paints good and bad apart: the naive scheme dies with delay, the replica does not", async () => {
    await page.page.getByTestId("measure").selectOption("force_nrmse");
    const longest = Math.max(...cellsOf("iid", 0).map(({ one_way_delay_s }) => one_way_delay_s));
    const [dead, alive] = ["position_force", "replica"].map((scheme) =>
      cellsOf("iid", 0).find((cell) => cell.scheme === scheme && cell.one_way_delay_s === longest && cell.loss === 0));
    expect([dead?.stable, alive?.stable]).toEqual([false, true]);
    const [red, green] = await Promise.all([dead, alive].map((cell) => colourOf(cell)));
    expect(red[1]).toBeLessThan(red[0]);
    expect(green[0]).toBeLessThan(green[1]);
    expect(await buttonOf(dead).innerText()).toContain("✕");
  });

  it("gives every number of the cell under the mouse", async () => {
    for (const cell of [cellsOf("iid", 0)[0], cellsOf("iid", 0).at(-1)]) {
      await buttonOf(cell).hover();
      const details = page.page.getByTestId("details");
      await until("the details are of this cell", async () => (await details.getAttribute("data-cell")) === nameOf(cell));
      const numbers = new Map(await Promise.all((await details.locator("dl > div").all()).map(async (entry) =>
        [await entry.locator("dt").innerText(), await entry.locator("dd").innerText()] as const)));
      expect(numberIn(numbers.get("packets") ?? "")).toBeCloseTo(cell?.packets_per_s ?? Number.NaN, -1);
      if (cell?.force_nrmse !== null) expect(near(numberIn(numbers.get("force error") ?? ""), 100 * (cell?.force_nrmse ?? Number.NaN))).toBe(true);
      expect(numbers.get("runs")).toContain(cell?.stable === true ? "stable" : "%".slice(0, 0));
    }
  });

  it("turns to another measure, another line, another jitter", async () => {
    const cell = cellsOf("iid", 0).find(({ scheme, one_way_delay_s }) => scheme === "wave" && 0 < one_way_delay_s);
    const before = await buttonOf(cell).innerText();
    await page.page.getByTestId("measure").selectOption("packets_per_s");
    await until("the cell holds another number", async () => (await buttonOf(cell).innerText()) !== before);
    for (const profile of new Set(table.cells.map((each) => each.profile))) {
      await page.choose("profile", profile);
      const jitters = [...new Set(table.cells.filter((each) => each.profile === profile).map(({ jitter_ratio }) => jitter_ratio))];
      const least = Math.min(...jitters);
      const want = cellsOf(profile, least).length;
      await until(`${profile} has its cells`, async () => (await page.page.locator(".heatmap td button").count()) === want);
    }
    await page.choose("profile", "iid");
    await page.page.getByTestId("measure").selectOption("force_nrmse");
  });

  it("shows the oracle: the naive wall against theory", async () => {
    const rows = await page.page.getByTestId("wall").locator("tbody tr").count();
    expect(rows).toBe(table.wall.length);
    expect(rows).toBeGreaterThan(3);
    expect(await page.page.getByTestId("wall").locator('[data-grade="bad"]').count()).toBe(0);
  });

  it("refuses a file that is no table, and keeps the one it has", async () => {
    await page.page.getByTestId("table-file").setInputFiles({ name: "no.json", mimeType: "application/json", buffer: Buffer.from("{}") });
    await page.saying("table-refusal", "no.json is no latency table");
    expect(await page.page.locator(".heatmap").count()).toBeGreaterThan(0);
    await page.page.getByTestId("table-file").setInputFiles(file);
    await until("the refusal is gone", async () => (await page.page.getByTestId("table-refusal").count()) === 0);
  });

  it("fits desk and telephone, light and dark", async () => {
    expect(await page.fit("latency")).toEqual([]);
  });

  it("gives the browser nothing to complain about", () => {
    expect(page.complaints).toEqual([]);
  });
});

function cellsOf(profile: string, jitter_ratio: number): LatencyCell[] {
  return table.cells.filter((cell) => cell.profile === profile && cell.jitter_ratio === jitter_ratio);
}

/** What the page calls a cell. */
function nameOf(cell: LatencyCell | undefined): string {
  if (cell === undefined) throw new Error("the table has no such cell");
  return `${cell.scheme} ${cell.one_way_delay_s} ${cell.loss}`;
}

function buttonOf(cell: LatencyCell | undefined): ReturnType<WatchedPage["page"]["locator"]> {
  return page.page.locator(`.heatmap button[data-cell="${nameOf(cell)}"]`);
}

/** Red, green, blue of a cell as painted. */
async function colourOf(cell: LatencyCell | undefined): Promise<number[]> {
  return buttonOf(cell).evaluate((button) => {
    const context = new OffscreenCanvas(1, 1).getContext("2d");
    if (context === null) throw new Error("no canvas to mix colours on");
    context.fillStyle = getComputedStyle(button).backgroundColor;
    context.fillRect(0, 0, 1, 1);
    return [...context.getImageData(0, 0, 1, 1).data];
  });
}

function near(got: number, want: number): boolean {
  return Math.abs(got - want) <= 0.006 * Math.abs(want) + 1e-6;
}
