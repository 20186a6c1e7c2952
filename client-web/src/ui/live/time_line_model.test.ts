import { describe, expect, it } from "vitest";
import type { Stroke, Strokes } from "../../protocol/strokes";
import { cuttingAt, lanesOf, shareOf, takenBackFrom, ticksOf, timeAfter, timeAt } from "./time_line_model";

function stroke(number: number, from_s: number, to_s: number, change: Partial<Stroke> = {}): Stroke {
  return { number, tool: 1, operator: "Ada", from_s, to_s, removed_volume_m3: 1e-6, undone: false, ...change };
}

const LINE: Strokes = {
  from_s: 10, to_s: 60,
  strokes: [
    stroke(1, 10, 20), stroke(2, 22, 27.5), stroke(3, 30, 40, { undone: true }),
    stroke(4, 35, 45, { tool: 2, operator: "Bob" }), stroke(5, 50, 60),
  ],
};

describe("the line", () => {
  it("has moments where they stand, and back, to a tick", () => {
    expect([10, 22.5, 60, 0, 99].map((time_s) => shareOf(time_s, LINE))).toEqual([0, 0.25, 1, 0, 1]);
    for (let time_s = 10; time_s <= 60; time_s += 0.137) {
      expect(timeAt(shareOf(time_s, LINE), LINE)).toBeCloseTo(time_s, 3);
      expect(Number.isInteger(Math.round(1e6 * timeAt(shareOf(time_s, LINE), LINE)) / 1000)).toBe(true);
    }
    expect([timeAt(-1, LINE), timeAt(2, LINE)]).toEqual([10, 60]);
    // A block that is just there.
    expect(shareOf(10, { from_s: 10, to_s: 10 })).toBe(1);
  });

  it("has a lane to every tool, and in it every stroke once, where and as long as it was", () => {
    const lanes = lanesOf(LINE, 1000);
    expect(lanes.map(({ tool, operators }) => [tool, operators])).toEqual([[1, ["Ada"]], [2, ["Bob"]]]);
    const marks = lanes.flatMap((lane) => lane.marks);
    expect(marks.flatMap(({ strokes }) => strokes.map(({ number }) => number)).sort()).toEqual([1, 2, 3, 4, 5]);
    const third = marks.find(({ strokes }) => strokes[0].number === 3);
    expect(third).toMatchObject({ isUndone: true, from_s: 30, to_s: 40 });
    expect(third?.left).toBeCloseTo(0.4, 9);
    expect(third?.width).toBeCloseTo(0.2, 9);
  });

  it("names who held the tool last, last", () => {
    const strokes = [stroke(1, 0, 1), stroke(2, 2, 3, { operator: "Bob" }), stroke(3, 4, 5)];
    expect(lanesOf({ strokes, from_s: 0, to_s: 6 }, 600)[0].operators).toEqual(["Bob", "Ada"]);
  });

  it("draws no more marks than there is room for, and loses no stroke, in whatever order they come", () => {
    let seed = 1;
    const chance = (): number => (seed = (seed * 48_271) % 2_147_483_647) / 2_147_483_647;
    const strokes = Array.from({ length: 3000 }, (_, n) => {
      const from_s = 36_000 * chance();
      return stroke(n + 1, from_s, from_s + 3 * chance(), { undone: chance() < 0.01 });
    });
    for (const width_px of [1, 200, 1000]) {
      const [{ marks }] = lanesOf({ strokes, from_s: 0, to_s: 36_100 }, width_px);
      expect(marks.flatMap((mark) => mark.strokes)).toHaveLength(3000);
      // The undone ones stand apart.
      expect(marks.length).toBeLessThanOrEqual(width_px / 4 + 2 * strokes.filter(({ undone }) => undone).length + 2);
      for (const mark of marks) {
        expect(new Set(mark.strokes.map(({ undone }) => undone)).size).toBe(1);
        expect(0 <= mark.left && mark.left + mark.width <= 1 + 1e-9).toBe(true);
        expect(mark.width * width_px).toBeGreaterThanOrEqual(Math.min(4, width_px) - 1e-9);
      }
    }
  });

  it("is labelled at whole steps of a clock, each with room", () => {
    expect(ticksOf({ from_s: 0, to_s: 10 }, 640)).toEqual([1, 2, 3, 4, 5, 6, 7, 8, 9]);
    expect(ticksOf({ from_s: 7, to_s: 130 }, 320)).toEqual([30, 60, 90, 120]);
    for (const to_s of [0.5, 3, 59, 61, 1000, 9999, 1e5, 3e6]) {
      for (const width_px of [50, 300, 1400]) {
        const ticks = ticksOf({ from_s: 0.3, to_s }, width_px);
        expect(ticks.length).toBeLessThanOrEqual(width_px / 64 + 2);
        // The longest label, `10:00:00`, takes 45 px.
        for (const time_s of ticks) {
          const place_px = (width_px * (time_s - 0.3)) / (to_s - 0.3);
          expect(23 <= place_px && place_px <= width_px - 23, `${time_s} of ${to_s} on ${width_px} px`).toBe(true);
        }
        for (let n = 1; n < ticks.length; n += 1) {
          expect(((ticks[n] - ticks[n - 1]) / to_s) * width_px).toBeGreaterThanOrEqual(60);
        }
      }
    }
  });
});

describe("keys on the line", () => {
  it("step, jump from edge to edge of strokes, and reach both ends", () => {
    // A hundredth of 50 s.
    expect(timeAfter("ArrowLeft", 30, LINE)).toBe(29.5);
    expect(timeAfter("ArrowRight", 30, LINE)).toBe(30.5);
    const back: number[] = [];
    for (let at_s = 60; at_s !== 10; at_s = timeAfter("PageDown", at_s, LINE) ?? Number.NaN) back.push(at_s);
    expect(back).toEqual([60, 50, 45, 40, 35, 30, 27.5, 22, 20]);
    const forth: number[] = [];
    for (let at_s = 10; at_s !== 60; at_s = timeAfter("PageUp", at_s, LINE) ?? Number.NaN) forth.push(at_s);
    expect(forth).toEqual([10, 20, 22, 27.5, 30, 35, 40, 45, 50]);
    expect([timeAfter("Home", 30, LINE), timeAfter("End", 30, LINE), timeAfter("x", 30, LINE)]).toEqual([10, 60, undefined]);
  });

  it("stay on the line, and move even where that is short", () => {
    expect([timeAfter("ArrowLeft", 10, LINE), timeAfter("ArrowRight", 60, LINE)]).toEqual([10, 60]);
    expect([timeAfter("PageDown", 10, LINE), timeAfter("PageUp", 60, LINE)]).toEqual([10, 60]);
    expect(timeAfter("ArrowLeft", 2, { strokes: [], from_s: 1, to_s: 2 })).toBe(1.9);
  });
});

describe("going on from a moment", () => {
  /** What undo {since} leaves, as the contract has it. */
  const left = (since: number): number[] => LINE.strokes.filter(({ number, undone }) => !undone && number < since).map(({ number }) => number);

  it("leaves nothing that was cut later, and takes back nothing that had to stay", () => {
    for (let at_s = 10; at_s < 60; at_s += 0.25) {
      const taken = takenBackFrom(at_s, LINE.strokes);
      const since = taken?.since ?? Number.POSITIVE_INFINITY;
      const stays = left(since);
      for (const { number, to_s } of LINE.strokes) if (stays.includes(number)) expect(to_s).toBeLessThanOrEqual(at_s);
      // The stroke before the first that goes had ended.
      expect(LINE.strokes.some(({ number, to_s }) => number === since && at_s < to_s)).toBe(taken !== undefined);
      expect(taken?.count ?? 0).toBe(4 - stays.length);
    }
  });

  it("says whether the first of them had begun", () => {
    expect(takenBackFrom(21, LINE.strokes)).toEqual({ since: 2, count: 3, hadBegun: false });
    expect(takenBackFrom(25, LINE.strokes)).toEqual({ since: 2, count: 3, hadBegun: true });
    expect(takenBackFrom(47, LINE.strokes)).toEqual({ since: 5, count: 1, hadBegun: false });
  });

  it("is nothing where all of it is undone, or nothing came later", () => {
    expect(takenBackFrom(60, LINE.strokes)).toBeUndefined();
    expect(takenBackFrom(0, [stroke(1, 1, 2, { undone: true })])).toBeUndefined();
  });

  it("tells who was cutting", () => {
    expect([21, 25, 37].map((at_s) => cuttingAt(at_s, LINE.strokes))).toEqual([undefined, "stroke 2 of Ada", "stroke 3 of Ada and stroke 4 of Bob"]);
  });
});
