// A recording in the page: at any moment of it, the clay and the numbers that were there then.

import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { beforeAll, describe, expect, it } from "vitest";
import { decodeFilmMoment, type FilmMoment } from "../src/protocol/film";
import { decodeRecordings } from "../src/protocol/text";
import { benchAt, numberIn } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

const BINARIES = resolve(process.env["TELECLAY_BIN_DIR"] ?? join(import.meta.dirname, "../../target/release"));
const NAME = "seen";

const opened = benchAt("#/live?session=demo&picture=plain", ["--session", "demo", "--intent", "cutting"]);
let teleclay: Teleclay;
let page: WatchedPage;
/** The file as the server has it. */
let file = "";
beforeAll(() => {
  ({ teleclay, page } = opened());
});

/** What the command line tells of a moment, which tests/python/recordings.py compares with other people's readers. */
function told(at_s: number): FilmMoment {
  return decodeFilmMoment(execFileSync(join(BINARIES, "teleclay-replay"), [file, "--at-s", String(at_s)], { encoding: "utf8" }));
}

const root = (): ReturnType<WatchedPage["page"]["locator"]> => page.page.getByTestId("recording");
const slider = (): ReturnType<WatchedPage["page"]["locator"]> => page.page.getByTestId("reel-time");
const shown_s = async (): Promise<number> => Number(await root().getAttribute("data-at-s"));

/** What is shown of a moment is the last tick before it; ticks that follow a hand may be a little further apart. */
const TICK_S = 0.0015;
const isAt = async (at_s: number): Promise<boolean> => {
  const before_s = at_s - (await shown_s());
  return -1e-6 < before_s && before_s < TICK_S;
};

/** Moves the slider as a hand does, and waits for the moment. */
async function go(at_s: number): Promise<void> {
  await slider().evaluate((input, to) => {
    if (!(input instanceof HTMLInputElement)) throw new Error("no slider");
    input.value = String(to);
    input.dispatchEvent(new Event("input", { bubbles: true }));
  }, at_s);
  await until(`moment ${at_s} s is shown`, () => isAt(at_s));
}

async function lasts_s(): Promise<number> {
  return Number(await slider().getAttribute("max"));
}

describe("a recording in the page", () => {
  it("is shown while it still goes on, up to what was written", async () => {
    await teleclay.ask("sessions/demo/recordings", { name: NAME });
    await until("three seconds are recorded", async () => {
      const list = decodeRecordings(await (await fetch(`${teleclay.url}/api/v1/sessions/demo/recordings`)).text());
      return 3000 <= list[0].ticks;
    });
    await page.page.goto(`${teleclay.url}/#/recording?session=demo&recording=${NAME}&picture=plain`);
    await until("it is read", async () => (await root().getAttribute("data-state")) === "read");
    expect(await page.text("reel-remarks")).toContain("still goes on");
    const before_s = await lasts_s();
    expect(before_s).toBeGreaterThan(1);
    await until("more is there", async () => {
      if (await page.page.getByTestId("reel-more").isVisible()) await page.page.getByTestId("reel-more").click();
      return before_s + 0.5 < (await lasts_s());
    });
  });

  it("has at any moment the clay and the numbers that another reader finds there", async () => {
    await teleclay.ask(`sessions/demo/recordings/${NAME}/stop`, {});
    const bytes = new Uint8Array(await (await fetch(`${teleclay.url}/api/v1/sessions/demo/recordings/${NAME}.mcap`)).arrayBuffer());
    file = join(mkdtempSync(join(tmpdir(), "teleclay-reel-")), "seen.mcap");
    writeFileSync(file, bytes);
    await page.page.reload();
    await until("all of it is read", async () => (await root().getAttribute("data-state")) === "read");
    expect(await page.text("clay-same")).toBe("same");
    const end_s = await lasts_s();
    for (const share of [0.9, 0.2, 0.55, 0.21, 0.7]) {
      // To the tick.
      const at_s = Math.round(share * end_s * 1000) / 1000;
      await go(at_s);
      const wanted = told(at_s);
      expect(await page.text("clay-hash")).toBe(wanted.clay?.hash);
      expect(Number(await root().getAttribute("data-tick"))).toBe(wanted.tick);
      const values = wanted.tools[0].values.map(Number);
      expect(await page.number("tool-force")).toBeCloseTo(Math.hypot(...values.slice(6, 9)), 2);
      expect(await page.number("value-position-1")).toBeCloseTo(1000 * values[12], 1);
    }
    await page.keep("reel");
  });

  it("plays, faster where that is asked for, and pauses at a key", async () => {
    await go(0.5);
    await page.page.getByTestId("reel-play").click();
    await until("time passes", async () => 0.8 < (await shown_s()));
    await slider().focus();
    await page.page.keyboard.press("Space");
    const rests_s = await shown_s();
    expect(await page.text("reel-play")).toContain("Play");
    await page.page.keyboard.press("ArrowLeft");
    await until("it is a step earlier", async () => (await shown_s()) < rests_s);
    await page.page.keyboard.press("End");
    await until("it is at its end", async () => isAt(await lasts_s()));
    await page.page.keyboard.press("[");
    await until("it is at a mark", async () => (await shown_s()) <= await lasts_s());
    expect(Number(await page.page.getByTestId("reel-marks").getAttribute("data-count"))).toBeGreaterThan(1);
    expect(await page.text("reel-events")).toContain("the recording begins");
  });

  it("shows another moment as another picture", async () => {
    await go(0.2);
    const before = await page.pictureAtRest();
    await go(await lasts_s());
    const after = await page.pictureAtRest();
    expect(await page.share(before, after)).toBeGreaterThan(0.001);
  });

  it("opens a file, and says in words where it is cut off or none", async () => {
    const bytes = readFileSync(file);
    await page.page.getByTestId("reel-file").setInputFiles({ name: "torn.mcap", mimeType: "application/octet-stream", buffer: bytes.subarray(0, Math.floor(0.6 * bytes.length)) });
    await until("it is read", async () => (await root().getAttribute("data-state")) === "read");
    expect(await page.text("reel-remarks")).toContain("cut off");
    expect(numberIn(await page.text("reel-progress"))).toBeGreaterThan(0.5);
    await page.page.getByTestId("reel-file").setInputFiles({ name: "teapot.mcap", mimeType: "application/octet-stream", buffer: Buffer.from("solid teapot\nendsolid teapot\n") });
    await page.saying("reel-trouble", "is no MCAP file");
    await page.keep("reel-none");
  });

  it("fits on a desk and on a telephone, and complains of nothing", async () => {
    await page.page.getByTestId("reel-file").setInputFiles(file);
    await until("it is read", async () => (await root().getAttribute("data-state")) === "read");
    expect(await page.fit("reel")).toEqual([]);
    expect(page.complaints).toEqual([]);
  });
});
