// What every file of these tests starts and ends: a server of its own, a hand where one is needed, a browser with one
// page.

import type { Browser } from "playwright-core";
import { afterAll, beforeAll, beforeEach, expect } from "vitest";
import { Teleclay } from "./processes";
import { launch, WatchedPage } from "./watched_page";

export interface Bench {
  readonly teleclay: Teleclay;
  readonly page: WatchedPage;
}

/**
 * Opens a page of the dashboard for the tests of a file; they ask for it once they run. `hand`: what the simulated hand
 * does.
 */
export function benchAt(address: string, hand: "nobody" | readonly string[]): () => Bench {
  let bench: Bench | undefined;
  let teleclay: Teleclay | undefined;
  let browser: Browser | undefined;
  const opened = (): Bench => {
    if (bench === undefined) throw new Error("the page is not open");
    return bench;
  };

  beforeAll(async () => {
    teleclay = await Teleclay.onFreePorts();
    await teleclay.startServer();
    if (hand !== "nobody") teleclay.startHandle(...hand);
    browser = await launch();
    bench = { teleclay, page: await WatchedPage.open(browser, `${teleclay.url}/${address}`) };
  });
  // What the programs and the page said, where a test fails.
  beforeEach(({ onTestFailed }) => onTestFailed(() => {
    process.stderr.write(`${teleclay?.said ?? ""}\n${[...new Set(bench?.page.complaints)].join("\n")}\n`);
  }));
  afterAll(async () => {
    await browser?.close();
    await teleclay?.end();
  });
  return opened;
}

/** Takes the number at the start of a text: a cell of a table, an instrument. */
export function numberIn(text: string): number {
  const digits = /[−-]?\d[\d   ]*(\.\d+)?(e[−-]?\d+)?/.exec(text)?.[0] ?? "";
  return Number.parseFloat(digits.replaceAll("−", "-").replaceAll(/[   ]/g, ""));
}

/** Fails unless two numbers agree to within a share of the second. */
export function expectNear(what: string, got: number, want: number, share: number): void {
  expect(Math.abs(got - want) <= share * Math.abs(want), `${what} is ${got}, want ${want} within ${share * 100} %`).toBe(true);
}
