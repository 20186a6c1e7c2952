// The time line of Live against the real server: undo and redo, clay as it was, going on from there, clay from a file.

import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import type { Strokes } from "../src/protocol/strokes";
import { decodeStrokes } from "../src/protocol/text";
import { benchAt } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/** Three strokes, each deeper than the one before and far enough from it in time; then the hand rests in the air. */
const STROKES = Array.from({ length: 3 }, (_, n) => {
  const depth_m = -0.003 - 0.002 * n;
  return `-0.03,0,0.01@0.08;-0.03,0,${depth_m}@0.08;0.03,0,${depth_m}@0.08;0.03,0,0.01@0.08`;
}).join(";");
/** Share of the picture that a groove has to change before it counts as seen. */
const SEEN = 0.002;
/** The same picture, drawn from another mesh of the same clay: edges are smoothed a little differently. */
const ALIKE = 0.02;

const opened = benchAt("#/live?picture=plain", ["--session", "demo", "--intent", "trajectory", "--waypoints", STROKES]);
let teleclay: Teleclay;
let page: WatchedPage;
/** The clay's hash after so many strokes. */
const hashes: string[] = [];
beforeAll(async () => {
  ({ teleclay, page } = opened());
  hashes[3] = await until("three strokes are cut, and the hand rests", async () => {
    const { strokes } = await history();
    const [first] = (await teleclay.session()).tools;
    const rests = first.connected && 0.008 < first.handle_position_m[2];
    return strokes.length === 3 && rests ? (await teleclay.session()).clay.hash : undefined;
  });
}, 300_000);

describe("the time line", () => {
  it("shows every stroke, in its order, at its time", async () => {
    await until("three strokes are shown", async () => (await line("data-strokes")) === "3");
    const boxes = await Promise.all([1, 2, 3].map((number) => boxOf(`stroke-${number}`)));
    for (let n = 1; n < 3; n += 1) expect(boxes[n - 1].x + boxes[n - 1].width).toBeLessThan(boxes[n].x);
    const { strokes: [first] } = await history();
    const track = await trackBox();
    const { from_s, to_s } = await history();
    // The line may be some seconds old, and grows all the while.
    expect((boxes[0].x - track.x) / track.width).toBeGreaterThan((first.from_s - from_s) / (to_s - from_s) - 0.02);
    expect(await page.page.getByTestId("stroke-1").getAttribute("title")).toMatch(/^stroke 1 · .+ · \d+\.\d to \d+\.\d s · \d\.\d\d cm³$/);
    await page.keep("time-line");
  });

  it("takes strokes back and cuts them again: the same clay to the last bit, every time", async () => {
    const whole = (await teleclay.session()).clay;
    for (const left of [2, 1, 0]) {
      await page.page.getByTestId("undo").click();
      await until(`${left} strokes are left`, async () => (await line("data-undone")) === String(3 - left));
      const { clay } = await teleclay.session();
      expect(clay.epoch).toBe(whole.epoch + 3 - left);
      expect(clay.removed_units).toBeLessThan(whole.removed_units);
      expect(clay.removed_units + clay.remaining_units).toBe(clay.initial_units);
      hashes[left] = clay.hash;
    }
    expect(new Set(hashes).size).toBe(4);
    expect(await page.page.getByTestId("undo").isDisabled()).toBe(true);
    await page.keep("all-undone");
    for (const there of [1, 2, 3]) {
      await page.page.getByTestId("redo").click();
      await until(`${there} strokes are there`, async () => (await line("data-undone")) === String(3 - there));
      expect((await teleclay.session()).clay.hash).toBe(hashes[there]);
    }
    expect(await page.page.getByTestId("redo").isDisabled()).toBe(true);
  });

  it("shows the clay as it was, says so, and changes nothing", async () => {
    const now = await page.pictureAtRest();
    const revision = (await teleclay.session()).revision;
    await slider().focus();
    await page.page.keyboard.press("Home");
    await shown();
    expect(await page.text("past")).toMatch(/As it was at \d+\.\d s/);
    await until("the picture has no groove", async () => SEEN < (await page.share(now, await page.picture())));
    await page.keep("past-fresh");
    // Just after the last stroke it is as it is now; only the tool is not in the picture.
    await page.page.getByTestId("back-to-now").click();
    await until("now is back", async () => (await page.page.getByTestId("past").count()) === 0);
    expect(await page.share(now, await page.pictureAtRest())).toBeLessThan(ALIKE);
    expect((await teleclay.session()).revision).toBe(revision);
  });

  it("asks for few of the moments that a hand passes over, and shows the last", async () => {
    const asked: string[] = [];
    page.page.on("request", (request) => {
      if (request.url().includes("at_s=")) asked.push(new URL(request.url()).searchParams.get("at_s") ?? "");
    });
    const track = await trackBox();
    const y = track.y + track.height / 2;
    await page.page.mouse.move(track.x + 0.9 * track.width, y);
    await page.page.mouse.down();
    const moves = 60;
    for (let n = 1; n <= moves; n += 1) await page.page.mouse.move(track.x + (0.9 - (0.7 * n) / moves) * track.width, y);
    await page.page.mouse.up();
    await shown();
    expect(asked.length).toBeLessThan(moves / 2);
    expect(Number(asked.at(-1))).toBeCloseTo(Number(await slider().getAttribute("aria-valuenow")), 3);
    // What was given up may still be under way at the server, which then asks for patience; the browser logs that.
    page.forgive("status of 503");
    await page.page.keyboard.press("Escape");
    await until("now is back", async () => (await page.page.getByTestId("past").count()) === 0);
  });

  it("goes on from a moment: what was cut later is taken back, and can be cut again", async () => {
    const [first, second] = await Promise.all([boxOf("stroke-1"), boxOf("stroke-2")]);
    const track = await trackBox();
    await page.page.mouse.click((first.x + first.width + second.x) / 2, track.y + track.height / 2);
    await shown();
    expect(await page.text("past")).toContain("takes back 2 strokes");
    await page.page.getByTestId("go-on-from-here").click();
    await until("now is back", async () => (await page.page.getByTestId("past").count()) === 0);
    expect(await line("data-undone")).toBe("2");
    expect((await teleclay.session()).clay.hash).toBe(hashes[1]);
    await page.keep("gone-on");
    for (const undone of ["1", "0"]) {
      await page.page.getByTestId("redo").click();
      await until(`${undone} are undone`, async () => (await line("data-undone")) === undone);
    }
    expect((await teleclay.session()).clay.hash).toBe(hashes[3]);
  });

  it("says that everything is kept, by saying nothing", async () => {
    await until("all of it is saved", async () => (await teleclay.session()).storage.state === "durable");
    expect(await page.page.getByTestId("storage").count()).toBe(0);
  });

  it("hands out the clay in three forms", async () => {
    for (const [format, begins] of [["3mf", "PK"], ["glb", "glTF"]] as const) {
      const downloading = page.page.waitForEvent("download");
      await page.page.getByTestId(format).click();
      const file = readFileSync(await (await downloading).path());
      expect(file.subarray(0, begins.length).toString("latin1")).toBe(begins);
      expect(file.length).toBeGreaterThan(1000);
    }
  });

  it("fits desk and telephone, light and dark, also in the past", async () => {
    await slider().focus();
    await page.page.keyboard.press("Home");
    await shown();
    expect(await page.fit("past")).toEqual([]);
    await page.page.getByTestId("back-to-now").click();
    expect(await page.fit("time-line")).toEqual([]);
  });

  it("makes clay of a closed file, and says what an open one lacks", async () => {
    const field = page.page.getByTestId("import-clay");
    await field.setInputFiles({ name: "open.stl", mimeType: "model/stl", buffer: cube(11) });
    await page.saying("import-refusal", /open\.stl: .*open/);
    await page.keep("import-refused");
    page.forgive("status of 422");
    const before = (await teleclay.session()).clay;
    await field.setInputFiles({ name: "cube.stl", mimeType: "model/stl", buffer: cube(12) });
    const { clay } = await until("the clay is another", async () => {
      const now = await teleclay.session();
      return before.epoch < now.clay.epoch ? now : undefined;
    });
    expect(clay.initial_volume_m3).toBeGreaterThan(0);
    expect(clay.initial_volume_m3).not.toBe(before.initial_volume_m3);
    await until("the refusal is gone", async () => (await page.page.getByTestId("import-refusal").count()) === 0);
    await until("its line is empty", async () => (await line("data-strokes")) === "0");
    await page.keep("imported");
  });

  it("gives the browser nothing to complain about", () => {
    expect(page.complaints).toEqual([]);
  });
});

/** The strokes as the server tells them. */
async function history(): Promise<Strokes> {
  const answer = await fetch(`${teleclay.url}/api/v1/sessions/demo/history`);
  if (!answer.ok) throw new Error(`the history was answered ${answer.status}: ${await answer.text()}`);
  return decodeStrokes(await answer.text());
}

function line(attribute: string): Promise<string | null> {
  return page.page.getByTestId("time-line").getAttribute(attribute);
}

function slider(): ReturnType<WatchedPage["page"]["getByRole"]> {
  return page.page.getByRole("slider", { name: "Moment on show" });
}

async function shown(): Promise<void> {
  await until("the past is shown", async () => (await line("data-moment")) === "shown");
}

interface Box {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

async function boxOf(id: string): Promise<Box> {
  const box = await page.page.getByTestId(id).boundingBox();
  if (box === null) throw new Error(`${id} is not on the page`);
  return box;
}

async function trackBox(): Promise<Box> {
  const box = await slider().boundingBox();
  if (box === null) throw new Error("the line is not on the page");
  return box;
}

/** A cube of 40 mm as binary STL, or as many of its twelve triangles as are wanted. */
function cube(triangles: number): Buffer {
  const corner = (n: number): number[] => [n & 1, (n >> 1) & 1, (n >> 2) & 1].map((bit) => 40 * bit);
  const faces = [
    [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
  ].slice(0, triangles);
  const file = Buffer.alloc(84 + 50 * faces.length);
  file.writeUInt32LE(faces.length, 80);
  faces.forEach((face, n) => face.flatMap(corner).forEach((mm, i) => file.writeFloatLE(mm, 84 + 50 * n + 12 + 4 * i)));
  return file;
}
