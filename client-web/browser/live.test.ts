// The Live page against the real server and a real handle, in a real browser.

import { readFileSync } from "node:fs";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it, onTestFailed } from "vitest";
import { Teleclay } from "./processes";
import { until } from "./until";
import { launch, VIEWPORT, WatchedPage } from "./watched_page";

/** Share of the picture that a cut has to change before it counts as seen. */
const SEEN = 0.004;

let teleclay: Teleclay;
let browser: Browser | undefined;
let live: WatchedPage;

beforeAll(async () => {
  teleclay = await Teleclay.onFreePorts();
  await teleclay.startServer();
  teleclay.startHandle();
  browser = await launch();
  live = await WatchedPage.open(browser, `${teleclay.url}/#/live?picture=plain`);
});

afterAll(async () => {
  await browser?.close();
  await teleclay.end();
});

describe("the Live page", () => {
  it("shows a session that runs and clay that is being removed", async () => {
    explain();
    await until("the session runs", async () => (await live.text("state")) === "running");
    const before = await until("clay is being removed", async () => (await live.number("removed")) || undefined, 60);
    await until("more clay is removed", async () => before < (await live.number("removed")), 60);
    expect(await live.page.title()).toBe("running · demo · teleclay");
    await until("the picture is drawn", async () => 0 < Number(await live.page.getByTestId("drawn").getAttribute("data-triangles")));
  });

  it("plots what happens", async () => {
    explain();
    for (const plot of ["force", "position", "velocity"]) {
      const canvas = live.page.getByTestId(`plot-${plot}`).locator("canvas");
      const before = await canvas.screenshot();
      await until(`the ${plot} plot moves`, async () => 0.001 < (await live.share(before, await canvas.screenshot())));
    }
    await live.page.getByRole("radio", { name: "y", exact: true }).check({ force: true });
    await live.page.getByRole("radio", { name: "x", exact: true }).check({ force: true });
  });

  it("pauses: the tool stops, and says so", async () => {
    explain();
    await pause();
    const [first, second] = [await atRest(), await atRest()];
    expect(second.tools[0].position_m).toEqual(first.tools[0].position_m);
    expect(second.clay.removed_units).toBe(first.clay.removed_units);
    expect(second.loop.ticks).toBeGreaterThan(first.loop.ticks);
    expect(await live.text("situation")).toContain("Paused");
    await live.keep("paused");
  });

  it("changes the clay's picture where it is cut, and gives the whole block back on a fresh one", async () => {
    explain();
    // The tool rests all the while: what differs is clay.
    const cut = await live.pictureAtRest();
    await live.page.getByTestId("fresh-block").click();
    await until("the volume is back", async () => (await live.number("removed")) === 0);
    const session = await teleclay.session();
    expect(session.clay.remaining_units).toBe(session.clay.initial_units);
    await until("the cut is gone from the picture", async () => SEEN < (await live.share(cut, await live.picture())));
    const whole = await live.pictureAtRest();

    await resume();
    await until("clay is removed again", async () => 0.3 < (await live.number("removed")), 90);
    await pause();
    const again = await live.pictureAtRest();
    expect(await live.share(whole, again)).toBeGreaterThan(SEEN);
    await resume();
  });

  it("changes the delay, and the round trip follows", async () => {
    explain();
    const before_ms = await live.milliseconds("rtt-p50");
    expect(before_ms).toBeLessThan(20);
    await live.set("/network/up/delay_s", "40");
    await until("the round trip is 80 ms longer", async () => 80 < (await live.milliseconds("rtt-p50")));
    const { up, down } = (await teleclay.session()).network;
    expect([up.delay_s, down.delay_s]).toEqual([0.04, 0.04]);
    await live.keep("delayed");
    await live.set("/network/up/delay_s", "0");
    await until("the round trip is short again", async () => (await live.milliseconds("rtt-p50")) < 20);
  });

  it("shows a refusal beside its field, and the server's own value", async () => {
    explain();
    await live.set("/network/up/delay_s", "5000");
    const field = live.page.getByTestId("/network/up/delay_s");
    await until("the refusal is shown", async () => (await field.getByRole("alert").count()) === 1);
    expect(await field.getByRole("alert").innerText()).toMatch(/5/);
    expect(await field.getByRole("textbox").inputValue()).toBe("0");
    await live.keep("refused");
    // The browser logs the answer's status by itself.
    live.forgive("status of 422");
    await live.set("/network/up/delay_s", "wide");
    expect(await field.getByRole("alert").innerText()).toContain("not a number");
    await live.set("/network/up/delay_s", "1");
    await until("the refusal goes", async () => (await field.getByRole("alert").count()) === 0);
    await live.set("/network/up/delay_s", "0");
  });

  it("offers every scheme: the loop takes it, or the page says in the server's words why not", async () => {
    explain();
    const choice = live.page.getByTestId("/scheme");
    const schemes = await choice.getByRole("radio").evaluateAll((inputs) =>
      inputs.map((input) => (input instanceof HTMLInputElement ? input.value : "")));
    expect(schemes).toEqual(["force_exchange", "position_force", "wave", "tdpa", "replica"]);
    let taken = 0;
    for (const scheme of schemes) {
      await choice.locator(`input[value=${scheme}]`).click();
      const edit = await until(`${scheme} is answered`, async () => {
        const now = await choice.getAttribute("data-edit");
        return now === "settled" || now === "refused" ? now : undefined;
      });
      if (edit === "settled") {
        taken += 1;
        expect((await teleclay.session()).scheme).toBe(scheme);
        expect(await choice.getByRole("alert").count()).toBe(0);
      } else expect(await choice.getByRole("alert").innerText()).toBe(await teleclay.refusalOfScheme(scheme));
    }
    expect(taken).toBeGreaterThan(0);
    await choice.locator("input[value=force_exchange]").click();
    await until("the scheme is the first again", async () => (await teleclay.session()).scheme === "force_exchange");
    live.forgive("status of 422");
  });

  it("changes the material on the running loop", async () => {
    explain();
    await live.set("/material/viscosity_pa_s_per_m", "123");
    await until("the clay is another", async () => (await teleclay.session()).material.viscosity_pa_s_per_m === 123_000);
  });

  it("hands out the clay as STL", async () => {
    explain();
    const downloading = live.page.waitForEvent("download");
    await live.page.getByTestId("stl").click();
    const stl = readFileSync(await (await downloading).path());
    const triangles = stl.readUInt32LE(80);
    expect(triangles).toBeGreaterThan(1000);
    expect(stl.length).toBe(84 + 50 * triangles);
  });

  it("says when nobody holds the handle, and when somebody does again", async () => {
    explain();
    await teleclay.killHandle();
    await until("it says that nobody is connected", async () =>
      (await live.page.getByTestId("situation").count()) === 1 && (await live.text("situation")).includes("No operator"));
    await live.keep("no-operator");
    teleclay.startHandle();
    await until("somebody is connected", async () => (await live.page.getByTestId("situation").count()) === 0);
  });

  it("says when the server is away, and comes back by itself", async () => {
    explain();
    live.serverIsAway = true;
    await teleclay.killServer();
    await until("the banner is there", async () =>
      (await live.page.getByTestId("banner").count()) === 1 && /server away, trying again/i.test(await live.text("banner")));
    expect(await live.page.locator(".shell").getAttribute("data-current")).toBe("false");
    expect(await live.page.getByTestId("pause").isDisabled()).toBe(true);
    expect(await live.page.title()).toContain("away");
    await live.keep("away");
    await teleclay.startServer();
    await until("the banner is gone", async () => (await live.page.getByTestId("banner").count()) === 0);
    live.serverIsAway = false;
    await until("the session runs again", async () => (await live.text("state")) === "running", 60);
    const before = await live.number("removed");
    await until("clay is removed again", async () => before < (await live.number("removed")), 60);
  });

  it("fits a telephone, and both themes are readable", async () => {
    explain();
    await live.page.setViewportSize({ width: 390, height: 844 });
    expect(await live.page.evaluate(() => document.documentElement.scrollWidth)).toBe(390);
    await live.keep("telephone");
    await live.page.setViewportSize(VIEWPORT);
    const theme = live.page.getByRole("button", { name: /Theme/ });
    for (const wanted of ["light", "dark"]) {
      await until(`the theme is ${wanted}`, async () => {
        if ((await theme.getAttribute("title")) === `theme: ${wanted}`) return true;
        await theme.click();
        return undefined;
      });
      expect(await live.page.evaluate(() => document.documentElement.dataset["theme"])).toBe(wanted);
      await live.keep(wanted);
    }
  });

  it("gives the browser nothing to complain about", () => {
    expect(live.complaints).toEqual([]);
  });
});

/** What the programs said, where a test fails. */
function explain(): void {
  onTestFailed(() => {
    process.stderr.write(`${teleclay.said}\n${live.complaints.join("\n")}\n`);
  });
}

async function pause(): Promise<void> {
  await live.page.getByTestId("pause").click();
  await until("the session is paused", async () => (await live.text("state")) === "paused");
}

async function resume(): Promise<void> {
  await live.page.getByTestId("pause").click();
  await until("the session runs", async () => (await live.text("state")) === "running");
}

/** The session once its tool has come to rest, which takes the ramp of a pause. */
async function atRest(): ReturnType<Teleclay["session"]> {
  let last = await teleclay.session();
  return until("the tool rests", async () => {
    const next = await teleclay.session();
    const still = last.loop.ticks + 20 < next.loop.ticks && next.tools[0].position_m.every((x, i) => x === last.tools[0].position_m[i]);
    last = next;
    return still ? next : undefined;
  });
}
