// Every page for everybody: what axe-core finds, light and dark, and a walk through each with the tab key.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import type { WatchedPage } from "./watched_page";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

/** Each page, and what tells that it shows what it is there for. */
const PAGES = {
  live: "drawn",
  sessions: "sessions",
  experiment: "cutting-done",
  stability: "verdict",
  robot: "robot",
  latency: "wall",
} as const;

/** More than any page has: a walk that comes to no end is one, too. */
const MOST_STOPS = 200;

const opened = benchAt("#/live?picture=plain", []);
let page: WatchedPage;
beforeAll(() => {
  ({ page } = opened());
});

describe("every page", () => {
  for (const [name, told] of Object.entries(PAGES)) {
    it(`${name}: axe finds nothing serious, light and dark`, async () => {
      await show(name, told);
      for (const theme of ["light", "dark"] as const) {
        await page.wear(theme);
        expect(await findings(), theme).toEqual([]);
      }
      await page.wear("light");
    });

    it(`${name}: every stop of the tab key is seen, and the walk comes to an end`, async () => {
      await show(name, told);
      await page.page.locator("#app a.brand").focus();
      const stops: string[] = [];
      const unseen: string[] = [];
      for (;;) {
        await page.page.keyboard.press("Tab");
        const stop = await page.page.evaluate(focused);
        if (stop === undefined || stop.isFirst) break;
        stops.push(stop.name);
        if (!stop.isSeen) unseen.push(stop.name);
        expect(stops.length, stops.slice(-5).join(", ")).toBeLessThan(MOST_STOPS);
      }
      expect(stops.length).toBeGreaterThan(8);
      expect(unseen).toEqual([]);
    });
  }

  it("live: axe finds nothing serious on a telephone, with the story told and a refusal shown", async () => {
    await show("live", PAGES.live);
    await page.page.setViewportSize({ width: 390, height: 844 });
    await page.page.locator(".story summary").click();
    await page.set("/network/up/delay_s", "wide");
    await page.page.getByTestId("/network/up/delay_s").getByRole("alert").waitFor();
    expect(await findings()).toEqual([]);
  });

  it("live: axe finds nothing serious in the tour", async () => {
    await show("live", PAGES.live);
    await page.page.getByTestId("tour-button").click();
    for (const theme of ["light", "dark"] as const) {
      await page.wear(theme);
      await page.page.getByTestId("tour").waitFor();
      expect(await findings(), theme).toEqual([]);
    }
  });
});

async function show(name: string, told: string): Promise<void> {
  await page.page.evaluate((address) => { location.hash = address; }, `#/${name}?picture=plain`);
  await page.page.getByTestId(told).first().waitFor();
}

/** What axe finds that keeps people out: the rule, and where. */
async function findings(): Promise<string[]> {
  await page.page.evaluate(AXE);
  return page.page.evaluate<string[]>(LOOK);
}

/** Runs in the browser, where the script above has put `axe`. */
const LOOK = `axe.run(document, { resultTypes: ["violations"] }).then(({ violations }) => violations
  .filter(({ impact }) => impact === "serious" || impact === "critical")
  .flatMap(({ id, nodes }) => nodes.map(({ html, failureSummary }) =>
    id + ": " + html.slice(0, 160) + " " + failureSummary.replaceAll(/\\s+/g, " ").slice(0, 220))))`;

/** Runs in the browser: what has the focus, and whether that can be seen; nothing where the browser itself has it. */
function focused(): { name: string; isFirst: boolean; isSeen: boolean } | undefined {
  const element = document.activeElement;
  if (element === null || element === document.body) return undefined;
  const isOutlined = (of: Element | null): boolean => {
    if (of === null) return false;
    const { outlineStyle, outlineWidth } = getComputedStyle(of);
    return outlineStyle !== "none" && 1 <= Number.parseFloat(outlineWidth);
  };
  const box = element.getBoundingClientRect();
  // A radio button or the choice of a file may look like something else: that shows it then.
  const stands = getComputedStyle(element).opacity === "0" ? [element.nextElementSibling, element.closest("label")] : [element];
  return {
    name: `${element.tagName.toLowerCase()} “${(element.getAttribute("aria-label") ?? element.textContent).trim().slice(0, 40)}” ${element.getAttribute("data-testid") ?? element.className}`,
    isFirst: element.matches("#app a.brand"),
    isSeen: stands.some(isOutlined) && 0 < box.width,
  };
}
