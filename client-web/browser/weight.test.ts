// What a page loads until somebody carves with it.

import { existsSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import { DASHBOARD, StandIn } from "./stand_in";
import { until } from "./until";
import { launch, VIEWPORT, WatchedPage } from "./watched_page";

/**
 * All of it, packed: what there is, 477 kB, and a little, so that it grows no further unseen. The aim is 450 kB, and
 * missed: the hand's module alone is 206.
 */
const MOST_BYTES = 480_000;

let standIn: StandIn;
let browser: Browser;
beforeAll(async () => {
  standIn = await StandIn.start();
  browser = await launch();
});
afterAll(async () => {
  await browser.close();
  standIn.end();
});

describe("the page", () => {
  it("weighs little until somebody carves", async () => {
    const loaded = new Set<string>();
    const ada = await WatchedPage.open(browser, `${standIn.url}/#/live?session=demo&operate=1&picture=plain`, "later", (pathname) => loaded.add(pathname));
    await until("she holds the tool", () => standIn.tool.operator === "guest");
    await ada.page.mouse.move(VIEWPORT.width / 3, VIEWPORT.height / 3);
    await until("the hand is held", async () => {
      await ada.page.mouse.down();
      return (await ada.page.getByTestId("scene").getAttribute("data-grasp")) === "held";
    });
    await ada.page.mouse.up();
    const packed = packedFiles(loaded);
    const weight = packed.reduce((sum, { bytes }) => sum + bytes, 0);
    process.stdout.write(`operating loads ${(weight / 1000).toFixed(1)} kB: ${packed.map(({ name, bytes }) => `${name} ${(bytes / 1000).toFixed(1)}`).join(", ")}\n`);
    // Or it would count what is not all.
    for (const part of [/^index-.*js$/, /^three-.*js$/, /^hands-.*js$/, /^hand-.*wasm$/, /^page-.*wasm$/]) {
      expect(packed.filter(({ name }) => part.test(name)).length, String(part)).toBe(1);
    }
    expect(weight).toBeLessThan(MOST_BYTES);
    expect(ada.complaints).toEqual([]);
  });
});

/** The files of the page among these addresses, each with its bytes as gzip packs it; the largest first. */
function packedFiles(addresses: ReadonlySet<string>): { readonly name: string; readonly bytes: number }[] {
  const paths = [...addresses].map((address) => (address === "/" ? "/index.html" : address)).filter((path) => existsSync(join(DASHBOARD, path)));
  const files = paths.map((path) => ({ name: path.split("/").at(-1) ?? path, bytes: gzipSync(readFileSync(join(DASHBOARD, path)), { level: 9 }).length }));
  return files.sort((a, b) => b.bytes - a.bytes);
}
