// The Live page against the real server and a real handle, in a real browser.

import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import type { ToolShape } from "../src/protocol/session";
import { benchAt, numberIn } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/** Share of the picture that a cut has to change before it counts as seen. */
const SEEN = 0.004;
const CM3 = 1e6;
/** A loaded machine's own round trip stays below this, ms. */
const SHORT_MS = 50;
/** What the test asks the conditioner for, there and back, ms. */
const LONG_MS = 160;

const opened = benchAt("#/live?picture=plain", []);
let teleclay: Teleclay;
let live: WatchedPage;
beforeAll(() => {
  ({ teleclay, page: live } = opened());
});

describe("the Live page", () => {
  it("shows a session that runs and clay that is being removed", async () => {
    await until("the session runs", async () => (await live.text("state")) === "running");
    const before = await until("clay is being removed", async () => (await live.number("removed")) || undefined);
    // More than the tool's own room by far: what is gone was cut.
    await until("more clay is removed", async () => 4 + before < (await live.number("removed")));
    expect(await live.page.title()).toBe("running · demo · teleclay");
    await until("the picture is drawn", async () => 0 < Number(await live.page.getByTestId("drawn").getAttribute("data-triangles")));
  });

  it("plots what happens", async () => {
    for (const plot of ["force", "position", "velocity"]) {
      const canvas = live.page.getByTestId(`plot-${plot}`).locator("canvas");
      const before = await canvas.screenshot();
      await until(`the ${plot} plot moves`, async () => 0.001 < (await live.share(before, await canvas.screenshot())));
    }
    await live.choose("plots", "link");
    for (const plot of ["energy", "hidden", "round-trip"]) {
      const canvas = live.page.getByTestId(`plot-${plot}`).locator("canvas");
      const before = await canvas.screenshot();
      await until(`the ${plot} plot moves`, async () => 0.0005 < (await live.share(before, await canvas.screenshot())));
    }
    await live.keep("link");
    await live.choose("plots", "motion");
    await live.choose("axis", "y");
    await live.choose("axis", "x");
  });

  it("pauses: the tool stops, and says so", async () => {
    await pause();
    const [first, second] = [await atRest(), await atRest()];
    expect(second.tools[0].position_m).toEqual(first.tools[0].position_m);
    expect(second.clay.removed_units).toBe(first.clay.removed_units);
    expect(second.loop.ticks).toBeGreaterThan(first.loop.ticks);
    expect(await live.text("situation")).toContain("Paused");
    await live.keep("paused");
  });

  it("changes the clay's picture where it is cut, and gives the whole block back on a fresh one", async () => {
    // The tool rests all the while: what differs is clay.
    // The hand goes on pushing, and its arrows with it, so that for minutes no two pictures are quite alike.
    const cut = await live.pictureAtRest(SEEN / 2);
    const before = (await teleclay.session()).clay;
    await live.page.getByTestId("fresh-block").click();
    // Where the tool stands in the clay there is none.
    const { clay } = await until("the block is a fresh and whole one", async () => {
      const now = await teleclay.session();
      return before.epoch < now.clay.epoch && now.clay.removed_volume_m3 <= volumeOf(now.tool) ? now : undefined;
    });
    expect(clay.remaining_units + clay.removed_units).toBe(clay.initial_units);
    await until("the page says so", async () => Math.abs((await live.number("removed")) - CM3 * clay.removed_volume_m3) < 0.006);
    await until("the cut is gone from the picture", async () => SEEN < (await live.share(cut, await live.picture())));
    const whole = await live.pictureAtRest(SEEN / 2);

    await resume();
    await until("clay is removed again", async () => 1 + CM3 * clay.removed_volume_m3 < (await live.number("removed")));
    await pause();
    // A picture that stands still may be one that what was told last is not in yet.
    await until("the new cut is in the picture", async () => SEEN < (await live.share(whole, await live.picture())));
    await resume();
  });

  it("changes the delay, and the round trip follows", async () => {
    // However loaded the machine: what is asked for is far above what it adds by itself, and comes on top of that.
    await until("the round trip is short", async () => within(await live.milliseconds("rtt-p50"), 0, SHORT_MS));
    await live.set("/network/up/delay_s", String(LONG_MS / 2));
    await until("the round trip is as long as asked for", async () => within(await live.milliseconds("rtt-p50"), LONG_MS, LONG_MS + SHORT_MS));
    const { up, down } = (await teleclay.session()).network;
    expect([up.delay_s, down.delay_s]).toEqual([LONG_MS / 2000, LONG_MS / 2000]);
    await live.keep("delayed");
    await live.set("/network/up/delay_s", "0");
    await until("the round trip is short again", async () => within(await live.milliseconds("rtt-p50"), 0, SHORT_MS));
  });

  it("changes the deadband, and fewer frames are sent", async () => {
    await until("every frame is sent", async () => 700 < (await teleclay.session()).loop.packets_down_per_s);
    await live.set("/deadband", "7");
    await until("few frames are sent", async () => (await teleclay.session()).loop.packets_down_per_s < 300);
    expect((await teleclay.session()).deadband).toBe(0.07);
    await live.set("/deadband", "0");
    await until("every frame is sent again", async () => 700 < (await teleclay.session()).loop.packets_down_per_s);
  });

  it("shows a refusal beside its field, and the server's own value", async () => {
    await live.set("/network/up/delay_s", "5000");
    const field = live.page.getByTestId("/network/up/delay_s");
    await until("the refusal is shown", async () => (await field.getByRole("alert").count()) === 1);
    expect(await field.getByRole("alert").innerText()).toMatch(/5/);
    expect(await field.getByRole("textbox").inputValue()).toBe("0");
    await live.keep("refused");
    // The browser logs the answer's status by itself.
    live.forgive("status of 422");
    await live.set("/network/up/delay_s", "wide");
    await until("nonsense is refused", async () => (await field.getByRole("alert").innerText()).includes("not a number"));
    await live.set("/network/up/delay_s", "1");
    await until("the refusal goes", async () => (await field.getByRole("alert").count()) === 0);
    await live.set("/network/up/delay_s", "0");
  });

  it("offers every scheme, and the running loop takes each", async () => {
    const choice = live.page.getByTestId("/scheme");
    const schemes = await choice.getByRole("radio").evaluateAll((inputs) =>
      inputs.map((input) => (input instanceof HTMLInputElement ? input.value : "")));
    expect(schemes).toEqual(["force_exchange", "position_force", "wave", "tdpa", "replica"]);
    const { scheme: first } = await teleclay.session();
    expect(await choice.locator("input:checked").inputValue()).toBe(first);
    // The first one last: the loop comes back to where it was.
    for (const scheme of [...schemes.filter((name) => name !== first), first]) {
      await choice.locator(`input[value=${scheme}]`).click();
      await until(`the session runs ${scheme}`, async () => (await teleclay.session()).scheme === scheme);
      await until(`the page shows ${scheme} as settled`, async () =>
        (await choice.getAttribute("data-edit")) === "settled" && (await choice.locator("input:checked").inputValue()) === scheme);
      expect(await choice.getByRole("alert").count()).toBe(0);
      expect((await teleclay.session()).fault).toBeNull();
    }
  });

  it("changes the material on the running loop", async () => {
    await live.set("/material/viscosity_pa_s_per_m", "123");
    await until("the clay is another", async () => (await teleclay.session()).material.viscosity_pa_s_per_m === 123_000);
  });

  it("shows what the hand's copy of the clay does, where the scheme has one", async () => {
    const { scheme: before } = await teleclay.session();
    await live.choose("/scheme", "replica");
    await until("the copy is live", async () => (await live.page.getByTestId("copy").getAttribute("data-copy")) === "live");
    expect((await teleclay.session()).tools[0].copy).toBe("live");
    // Alone in the clay, with a line that loses nothing, a copy hides nothing for long.
    await until("nothing is hidden", async () => (await live.number("hidden-force")) < 0.02);
    await live.choose("/scheme", "force_exchange");
    await until("there is no copy any more", async () => (await live.page.getByTestId("copy").count()) === 0);
    expect(await live.page.getByTestId("hidden-force").count()).toBe(0);
    await live.choose("/scheme", before);
    await until("the scheme is as before", async () => (await teleclay.session()).scheme === before);
  });

  it("tells the story in three steps: crisp, shaken by delay, calm with the replica on the same line", async () => {
    const { scheme, material, network } = await teleclay.session();
    await live.page.getByTestId("story").locator("summary").click();
    for (const [step, want, delay_s] of [["crisp", "position_force", 0], ["late", "position_force", 0.15], ["replica", "replica", 0.15]] as const) {
      await live.page.getByTestId(`step-${step}`).click();
      await until(`the session is at ${step}`, async () => {
        const now = await teleclay.session();
        return now.scheme === want && now.network.up.delay_s === delay_s && now.network.down.delay_s === delay_s;
      });
      await until(`${step} is measured`, async () => Number.isFinite(await shaking(step)));
      await live.keep(`story-${step}`);
    }
    // What the delay had set swinging dies away, and does not come again.
    const shaken = await shaking("late");
    await until("the hand is calm on the same line", async () => 2 * (await shaking("replica")) < shaken);
    await live.page.getByTestId("story-back").click();
    await until("all is as it was", async () => {
      const now = await teleclay.session();
      return now.scheme === scheme && now.material.viscosity_pa_s_per_m === material.viscosity_pa_s_per_m && now.network.up.delay_s === network.up.delay_s;
    });
    await live.page.getByTestId("story").locator("summary").click();
  });

  it("hands out the clay as STL", async () => {
    const downloading = live.page.waitForEvent("download");
    await live.page.getByTestId("stl").click();
    const stl = readFileSync(await (await downloading).path());
    const triangles = stl.readUInt32LE(80);
    expect(triangles).toBeGreaterThan(1000);
    expect(stl.length).toBe(84 + 50 * triangles);
  });

  it("shows how the force of one hand is corrected by what another cuts", async () => {
    await teleclay.create({
      id: "both", tools: 2, tool: { kind: "ball", radius_m: 0.0064 }, material: { viscosity_pa_s_per_m: 6e5 },
      network: { up: { delay_s: 0.04 }, down: { delay_s: 0.04 } },
    });
    for (const [name, first] of [["Ada", 1], ["Bob", -1]] as const) {
      teleclay.startHandle("--session", "both", "--operator", name, "--intent", "trajectory", "--waypoints", strokes(first));
    }
    await show("both");
    await live.choose("plots", "copy");
    const corrections = live.page.getByTestId("corrections");
    await until("something is corrected", async () => 10 < Number(await corrections.getAttribute("data-count")));
    expect(await corrections.innerText()).toMatch(/at most 0\.\d\d N in a tick/);
    for (const plot of ["hidden", "corrections", "age"]) {
      const canvas = live.page.getByTestId(`plot-${plot}`).locator("canvas");
      const before = await canvas.screenshot();
      await until(`the ${plot} plot moves`, async () => 0.0005 < (await live.share(before, await canvas.screenshot())));
    }
    await until("the other tool is in the picture", async () =>
      (await live.page.getByTestId("drawn").getAttribute("data-others")) === "1");
    await live.keep("corrections");
    await show("demo");
  });

  it("says when nobody holds the handle, and when somebody does again", async () => {
    await teleclay.killHandles();
    await until("it says that nobody is connected", async () =>
      (await live.page.getByTestId("situation").count()) === 1 && (await live.text("situation")).includes("No operator"));
    await live.keep("no-operator");
    teleclay.startHandle();
    await until("somebody is connected", async () => (await live.page.getByTestId("situation").count()) === 0);
  });

  it("says when the server is away, and comes back by itself", async () => {
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
    await until("the session runs again", async () => (await live.text("state")) === "running");
    const before = await live.number("removed");
    await until("clay is removed again", async () => before < (await live.number("removed")));
  });

  it("fits desk and telephone, light and dark", async () => {
    expect(await live.fit("live")).toEqual([]);
    expect(await live.page.evaluate(() => document.documentElement.dataset["theme"])).toBe("light");
  });

  it("gives the browser nothing to complain about", () => {
    expect(live.complaints).toEqual([]);
  });
});

/** To and fro along x, each stroke a little deeper than the one before. */
function strokes(first: number): string {
  return Array.from({ length: 24 }, (_, leg) =>
    `${0.03 * first * (leg % 2 === 0 ? 1 : -1)},0,${(-0.004 - 0.0015 * leg).toFixed(4)}@0.06`).join(";");
}

/** Shows another session, as somebody does who follows a link. */
async function show(session: string): Promise<void> {
  await live.page.evaluate((name) => {
    location.hash = `#/live?session=${name}&picture=plain`;
    location.reload();
  }, session);
  await until(`${session} is shown and runs`, async () => (await live.page.title()) === `running · ${session} · teleclay`);
}

/** What a tool removes where it is set down in the clay, m³. */
function volumeOf(tool: ToolShape): number {
  switch (tool.kind) {
    case "ball": return (4 / 3) * Math.PI * tool.radius_m ** 3;
    case "blade": return tool.width_m * tool.height_m * tool.thickness_m;
    case "cylinder": return Math.PI * tool.radius_m ** 2 * tool.height_m;
    case "loop": return Math.PI * (tool.ring_radius_m + tool.wire_diameter_m / 2) ** 2 * tool.wire_diameter_m;
  }
}

/** The value, where it lies between the two. */
function within(value: number, least: number, greatest: number): boolean {
  return least <= value && value <= greatest;
}

/** How far the hand's velocity swings in a step of the story, mm/s, as the page has measured it. */
async function shaking(step: string): Promise<number> {
  const row = live.page.getByTestId(`outcome-${step}`);
  return (await row.count()) === 0 ? Number.NaN : numberIn(await row.locator("td").nth(1).innerText());
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
