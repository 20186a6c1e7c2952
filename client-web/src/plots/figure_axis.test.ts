import { describe, expect, it } from "vitest";
import { AxisMap, decades, equalRanges, evenTicks } from "./figure_axis";

describe("an axis", () => {
  it("goes to pixels and back, linear and by decades, upwards too", () => {
    for (const [scale, range] of [["linear", [-3, 7]], ["log", [1e-2, 1e3]]] as const) {
      const map = new AxisMap({ label: "", scale, range }, 400, 20);
      expect(map.toPixels(range[0])).toBeCloseTo(400);
      expect(map.toPixels(range[1])).toBeCloseTo(20);
      for (const value of [0.5, 1, 6]) expect(map.toValue(map.toPixels(value))).toBeCloseTo(value, 9);
    }
    const map = new AxisMap({ label: "", scale: "log", range: [1, 100] }, 0, 200);
    expect(map.toPixels(10)).toBeCloseTo(100);
  });

  it("has round ticks within its range, zero without a sign", () => {
    const ticks = evenTicks({ label: "", scale: "linear", range: [-0.31, 0.52] }, 5);
    expect(ticks.map(({ text }) => text)).toEqual(["−0.2", "0.0", "0.2", "0.4"]);
    expect(evenTicks({ label: "", scale: "linear", range: [3, 12], step: 3 }, 99).map(({ text }) => text)).toEqual(["3", "6", "9", "12"]);
  });

  it("numbers its decades, fewer of them where there are many", () => {
    const few = decades({ label: "", scale: "log", range: [0.1, 100] }, 8);
    expect(few.filter(({ text }) => text !== undefined).map(({ text }) => text)).toEqual(["0.1", "1", "10", "100"]);
    expect(few.length).toBe(28);
    const many = decades({ label: "", scale: "log", range: [1e-6, 1e6] }, 4);
    expect(many.filter(({ text }) => text !== undefined).map(({ text }) => text)).toEqual(["10⁻⁶", "0.001", "1", "1000", "10⁶"]);
  });

  it("makes circles round without hiding anything", () => {
    const { x, y } = equalRanges([-2, 1], [-1, 1], 600, 300);
    expect((x[1] - x[0]) / 600).toBeCloseTo((y[1] - y[0]) / 300);
    expect(x[0]).toBeLessThanOrEqual(-2);
    expect(x[1]).toBeGreaterThanOrEqual(1);
    expect(y[0]).toBeLessThanOrEqual(-1);
    expect((x[0] + x[1]) / 2).toBeCloseTo(-0.5);
  });
});
