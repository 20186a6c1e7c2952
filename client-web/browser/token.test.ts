// Who comes to a server that wants a token: with none, with a wrong one, with an invite's link.

import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import { Teleclay } from "./processes";
import { until } from "./until";
import { launch, WatchedPage } from "./watched_page";

const TOKEN = "a-token-for-tests-only";

let teleclay: Teleclay;
let browser: Browser;
beforeAll(async () => {
  teleclay = await Teleclay.onFreePorts();
  await teleclay.startServer(TOKEN);
  browser = await launch();
});
afterAll(async () => {
  await browser.close();
  await teleclay.end();
});

async function opened(address: string): Promise<WatchedPage> {
  const page = await WatchedPage.open(browser, address);
  // The browser itself remarks on each answer 401.
  page.serverIsAway = true;
  return page;
}

async function show(page: WatchedPage, token: string): Promise<void> {
  await page.page.getByTestId("token").fill(token);
  await page.page.getByRole("button", { name: "Show it" }).click();
}

describe("a server that wants a token", () => {
  it("is asked with none, says so, refuses a wrong one, and takes the right one until the tab is closed", async () => {
    const page = await opened(`${teleclay.url}/#/live?picture=plain`);
    await page.saying("banner", "wants a token");
    expect(await page.page.getByTestId("token").getAttribute("type")).toBe("password");
    await show(page, "a wrong one, which is long");
    await page.saying("banner", "another one, or an invite that has ended");
    await show(page, TOKEN);
    await page.page.getByTestId("banner").waitFor({ state: "detached" });
    await page.saying("link", /bit\/s/);
    // It is nowhere but in this tab: neither in the address nor in another one.
    expect(page.page.url()).not.toContain(TOKEN);
    await page.page.reload({ waitUntil: "commit" });
    await page.saying("link", /bit\/s/);
    const other = await opened(`${teleclay.url}/#/live?picture=plain`);
    await other.saying("banner", "wants a token");
    await other.page.context().close();
    await page.page.context().close();
  });

  it("lets in who opens an invite's link, takes the token out of the address, and keeps to the role", async () => {
    const link = teleclay.invite("spectator");
    const token = /token=([^&]+)/.exec(link)?.[1] ?? "";
    expect(token.length).toBeGreaterThan(16);
    const page = await opened(`${teleclay.url}/${link.slice(link.indexOf("#"))}`);
    await page.saying("link", /bit\/s/);
    await until("the token is out of the address", async () => Promise.resolve(!page.page.url().includes("token=")));
    expect(await page.page.evaluate(() => document.documentElement.outerHTML)).not.toContain(token);
    const refused = await page.page.evaluate(async (shown) => (await fetch("/api/v1/sessions/demo/stop", {
      method: "POST", headers: { authorization: `Bearer ${shown}` },
    })).status, token);
    expect(refused).toBe(403);
    await page.page.context().close();
  });
});
