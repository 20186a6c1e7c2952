// What goes wrong at a page: numbers that mean nothing or two things, a graphics context that is taken away, a module
// that does not load, a stream that is closed.

import { beforeAll, describe, expect, it } from "vitest";
import { benchAt } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/** Share of the picture that may differ when it is drawn a second time: the tool's edges, smoothed or not. */
const SAME = 0.001;
/** Share of the picture that clay, tool and ground take up: without a picture that much is missing. */
const SEEN = 0.1;

/** So many looks at a picture that does not change take longer than anything that is still to come. */
const STILL_LOOKS = 20;

const opened = benchAt("#/live?picture=plain", []);
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(() => {
  ({ teleclay, page } = opened());
});

describe("a number that somebody types", () => {
  it("is refused in the unit that was typed", async () => {
    await settled();
    for (const [typed, said] of [
      ["3000", "3000 ms is not from 0 to 2000 ms"],
      ["3 s", "3 s is not from 0 to 2 s"],
      ["−1", "−1 ms is not from 0 to 2000 ms"],
    ] as const) {
      await page.set(DELAY, typed);
      await page.saying(DELAY, said);
    }
    await page.keep("refused-in-its-unit");
    await page.set("/deadband", "60");
    await page.saying("/deadband", "60 % is not from 0 to 50 %");
    await page.set("/material/stiffness_pa", "2 GPa");
    await page.saying("/material/stiffness_pa", "2 GPa is not from 0 to 1 GPa");
    // The browser logs the answers' status by itself.
    await until("the browser has logged it", () => 0 < page.complaints.length);
    page.forgive("status of 422");
    expect((await teleclay.session()).network.up.delay_s).toBe(0);
  });

  it("is asked about where it could mean two", async () => {
    await page.set(DELAY, "1,500");
    await page.saying(DELAY, "“1,500” could mean 1.5 or 1500: write 1.5 or 1500");
    await page.keep("asked-about");
    expect((await teleclay.session()).network.up.delay_s).toBe(0);
  });

  it("is taken with its unit, in full width, with other signs and spaces", async () => {
    for (const [typed, delay_s] of [["30 ms", 0.03], ["0,04 s", 0.04], ["２５", 0.025], ["\u00a035\u00a0ms\u00a0", 0.035], ["1 500", 1.5], ["0", 0]] as const) {
      await page.set(DELAY, typed);
      await until(`the delay is ${delay_s} s`, async () => (await teleclay.session()).network.up.delay_s === delay_s);
      await until("no refusal is left", async () => (await page.page.getByTestId(DELAY).getByRole("alert").count()) === 0);
    }
  });

  it("is refused by every field of every page, beside the field and in its own unit", async () => {
    const units = new Set<string>();
    for (const name of ["live", "experiment", "stability", "robot"]) {
      await open(name);
      if (name === "robot") await page.choose("source", "hand");
      const fields = page.page.locator(".field, td:has(> input.cell)");
      await until(`${name} has fields`, async () => 3 < (await fields.count()));
      for (let n = 0; n < (await fields.count()); n += 1) {
        const field = fields.nth(n);
        const box = field.getByRole("textbox");
        const before = await box.inputValue();
        const unit = (await field.locator(".unit").count()) === 0 ? "" : await field.locator(".unit").innerText();
        units.add(unit);
        const says = async (typed: string, said: RegExp): Promise<void> => {
          await box.fill(typed);
          await box.press("Enter");
          await until(`${name}, field ${n}, refuses ${typed}`, async () =>
            (await field.getByRole("alert").count()) === 1 && said.test(await field.getByRole("alert").innerText()));
          expect(await box.inputValue()).toBe(before);
        };
        await says("1,500", /could mean 1\.5 or 1500/);
        await says("", /a number is missing/);
        await says("∞", /not a finite number/);
        await says("many", /“many” is not a number/);
        const ownUnit = unit.includes("/hand") ? "" : unit;
        await says("1e30", new RegExp(`^1e30 ?${ownUnit.replaceAll(/[/·]/g, ".")}.* is not (from|below) .*${ownUnit.replaceAll(/[/·]/g, ".")}`));
      }
      await page.keep(`numbers-${name}`);
    }
    expect([...units].sort()).toEqual(["", "%", "MPa", "N", "N/m", "N·s/m", "clay/hand", "kPa", "kPa·s/m", "kg", "mm", "ms", "tool/hand"]);
    page.forgive("status of 422");
  });
});

describe("a graphics context that is taken away", () => {
  it("is said on Live until it is back, and then the picture is as it was", async () => {
    // A hand that rests: tool and ghost stand still in the picture.
    await teleclay.create({ id: "still", tool: { kind: "ball", radius_m: 0.0064 } });
    teleclay.startHandle("--session", "still", "--intent", "idle");
    for (const picture of ["plain", "fine"]) {
      await open(`live?session=still&picture=${picture}`);
      await page.page.reload();
      await until("the hand is there", async () => (await page.page.title()) === "running · still · teleclay");
      await until("the clay is drawn", async () => 0 < Number(await page.page.getByTestId("drawn").getAttribute("data-triangles")));
      const before = await whole(() => page.picture());
      const giveBack = await lose("clay");
      await page.saying("clay-lost", "the browser has taken the graphics context away");
      await page.saying("clay-lost", "comes back by itself");
      await page.saying("drawn", "no picture: graphics context lost");
      await until("no frame is counted", async () => (await page.page.getByTestId("drawn").getAttribute("data-frames")) === "0");
      await page.keep(`context-lost-${picture}`);
      expect(await page.share(before, await page.picture())).toBeGreaterThan(SEEN);
      await giveBack();
      await until("the message is gone", async () => (await page.page.getByTestId("clay-lost").count()) === 0);
      await page.saying("drawn", /^\d+ fps/);
      await until("the picture is as it was", async () => (await page.share(before, await page.picture())) < SAME);
      await page.keep(`context-back-${picture}`);
    }
  });

  it("can be asked for anew, when it does not come back", async () => {
    const before = await whole(() => page.picture());
    await lose("clay");
    await page.page.getByRole("button", { name: "Draw anew now" }).click();
    await until("the message is gone", async () => (await page.page.getByTestId("clay-lost").count()) === 0);
    await until("the picture is as it was", async () => (await page.share(before, await page.picture())) < SAME);
    await page.saying("drawn", /^\d+ fps/);
  });

  it("is said on Robot too", async () => {
    await open("robot");
    await page.choose("source", "hand");
    const robot = page.page.getByTestId("robot");
    await until("the workspace is mapped", async () => (await page.page.getByTestId("reach").count()) === 1);
    const before = await whole(() => robot.screenshot());
    const giveBack = await lose("robot");
    await page.saying("robot-lost", "the browser has taken the graphics context away");
    await page.keep("context-lost-robot");
    await giveBack();
    await until("the message is gone", async () => (await page.page.getByTestId("robot-lost").count()) === 0);
    await until("the robot is as it was", async () => (await page.share(before, await robot.screenshot())) < SAME);
    await lose("robot");
    await page.page.getByRole("button", { name: "Draw anew now" }).click();
    await until("the robot is drawn anew", async () => (await page.share(before, await robot.screenshot())) < SAME);
    await page.keep("context-back-robot");
  });
});

describe("a module that does not load", () => {
  it("is said, with the reason, wherever the page would calculate, and the rest goes on", async () => {
    await page.page.route("**/*.wasm", (route) => route.fulfill({ status: 404, body: "" }));
    await open("stability?picture=plain");
    await page.page.reload();
    await page.saying("verdict", /This page cannot calculate, as its module did not load: .*\.wasm answers 404\. Load the page again\./);
    await page.keep("module-missing-stability");
    await until("the server's margins are shown all the same", async () => (await page.page.getByTestId("gain-margin").count()) === 1);
    await open("robot?picture=plain");
    await page.saying("posture", "its module did not load");
    await open("live?session=demo&picture=plain");
    await until("the missing module is told among the events", async () =>
      (await page.page.locator(".notices li", { hasText: /the clay cannot be shown, as the page's module did not load: .*answers 404/ }).count()) === 1);
    await settled();
    await page.keep("module-missing-live");
    await page.page.unroute("**/*.wasm");
    await page.page.reload();
    await until("the clay is drawn", async () => 0 < Number(await page.page.getByTestId("drawn").getAttribute("data-triangles")));
    page.forgive("status of 404");
  });
});

describe("a stream that the server closes", () => {
  it("tells whoever sends too long a text why, before it ends", async () => {
    for (const length of [16_385, 163_840, 1_000_000]) {
      const { code, reason, problems } = await page.page.evaluate(sendTooMuch, { length, session: "demo" });
      expect([code, reason]).toEqual([1009, "messages have at most 16384 bytes"]);
      expect(problems).toEqual(["the message has more than 16384 bytes"]);
    }
  });

  it("is shown with its reason", async () => {
    await teleclay.create({ id: "brief" });
    await open("live?session=brief&picture=plain");
    await page.page.reload();
    await until("the session is shown", async () => (await page.page.title()).includes("brief"));
    await page.page.evaluate(() => fetch("api/v1/sessions/brief", { method: "DELETE" }));
    // Only until the next try, which finds another session.
    await page.saying("banner", "The server closed the stream: the session has ended (code 4404). Trying again");
    await until("another session is shown", async () => (await page.page.title()).includes("demo"));
  });

  it("gives the browser nothing to complain about", () => {
    page.forgive("CONTEXT_LOST_WEBGL");
    // The session was deleted under the page; its strokes and recordings may have been asked for in that moment.
    page.forgive("/sessions/brief/history");
    page.forgive("/sessions/brief/recordings");
    expect(page.complaints).toEqual([]);
  });
});

const DELAY = "/network/up/delay_s";

/** Goes to a page, as by its link. */
async function open(address: string): Promise<void> {
  await page.page.evaluate((hash) => {
    location.hash = `#/${hash}`;
  }, address);
  await until(`${address} is open`, async () => (await page.page.evaluate(() => location.hash)) === `#/${address}`);
}

async function settled(): Promise<void> {
  await until("the session runs", async () => (await page.text("state")) === "running");
}

/**
 * A picture once all of it is there: bricks come one after the other, shadows a second later, a workspace when it is
 * mapped.
 */
async function whole(take: () => Promise<Buffer>): Promise<Buffer> {
  let last = await take();
  let looks = 0;
  return until("the whole picture is drawn", async () => {
    const next = await take();
    looks = (await page.share(last, next)) === 0 ? looks + 1 : 0;
    last = next;
    return STILL_LOOKS <= looks ? next : undefined;
  });
}

/** Does to a canvas what a driver does that starts anew; returns what gives the context back. */
async function lose(canvas: string): Promise<() => Promise<void>> {
  const extension = await page.page.getByTestId(canvas).evaluateHandle((element) => {
    const found = element instanceof HTMLCanvasElement ? element.getContext("webgl2")?.getExtension("WEBGL_lose_context") : undefined;
    if (found === null || found === undefined) throw new Error("this browser cannot take a context away");
    found.loseContext();
    return found;
  });
  return () => extension.evaluate((found) => found.restoreContext());
}

/** Runs in the browser: what a stream says to a text that is too long, and how it ends. */
function sendTooMuch({ length, session }: { length: number; session: string }): Promise<{ code: number; reason: string; problems: string[] }> {
  return new Promise((resolve) => {
    const url = new URL(`api/v1/sessions/${session}/stream`, document.baseURI);
    url.protocol = "ws:";
    const socket = new WebSocket(url, "teleclay.v1");
    const problems: string[] = [];
    socket.onopen = () => socket.send(" ".repeat(length));
    socket.onmessage = ({ data }: MessageEvent<string>) => {
      const message: unknown = JSON.parse(data);
      if (typeof message === "object" && message !== null && "problem" in message) {
        const { problem } = message;
        if (typeof problem === "object" && problem !== null && "detail" in problem) problems.push(String(problem.detail));
      }
    };
    socket.onclose = ({ code, reason }) => resolve({ code, reason, problems });
  });
}
