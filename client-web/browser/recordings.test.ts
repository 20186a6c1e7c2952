// A session as a file, made and taken from the page.

import { readFile } from "node:fs/promises";
import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/** How a file of MCAP begins and ends. */
const MAGIC = Buffer.from([0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a]);

const opened = benchAt("#/live?session=demo&picture=plain", ["--session", "demo", "--intent", "cutting"]);
let page: WatchedPage;
beforeAll(() => {
  ({ page } = opened());
});

const row = (): ReturnType<WatchedPage["page"]["locator"]> => page.page.getByTestId("recordings").locator("li");

describe("recordings", () => {
  it("begin at a press and tell how much there is", async () => {
    await page.page.getByTestId("record").click();
    await until("a second is recorded", async () => 1 <= Number.parseFloat(await page.text("record-says")));
    await page.keep("recording");
  });

  it("end at another and can be saved as what other programs read", async () => {
    await page.page.getByTestId("record-end").click();
    await page.page.getByText("one recording").click();
    expect(await row().getAttribute("data-state")).toBe("ended");
    const [download] = await Promise.all([
      page.page.waitForEvent("download"),
      row().getByText("MCAP").click(),
    ]);
    expect(download.suggestedFilename()).toMatch(/^demo-.*\.mcap$/);
    const file = await readFile(await download.path());
    expect(file.subarray(0, 8)).toEqual(MAGIC);
    expect(file.subarray(-8)).toEqual(MAGIC);
    await page.keep("recorded");
  });

  it("are deleted when that was asked twice", async () => {
    await row().getByText("Delete").click();
    expect(await row().count()).toBe(1);
    await row().getByText("Delete now").click();
    await until("it is gone", async () => (await row().count()) === 0);
    expect(page.complaints).toEqual([]);
  });
});
