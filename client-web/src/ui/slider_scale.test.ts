import { describe, expect, it } from "vitest";
import { decades, linear, power, type SliderScale } from "./slider_scale";

const scales: Record<string, SliderScale> = { linear: linear(0.5), power: power(2, 2), decades: decades(1e3, 1e7) };

describe("a slider's scale", () => {
  it("comes back to where it was, to the two digits it gives", () => {
    for (const [name, scale] of Object.entries(scales)) {
      for (let share = 0.1; share <= 1; share += 0.05) {
        expect(scale.toShare(scale.toValue(share)), name).toBeCloseTo(share, 1);
      }
    }
  });

  it("reaches zero at the left end and its greatest at the right", () => {
    for (const scale of Object.values(scales)) {
      expect(scale.toValue(0)).toBe(0);
      expect(scale.toShare(0)).toBe(0);
    }
    expect(Object.values(scales).map((scale) => scale.toValue(1))).toEqual([0.5, 2, 1e7]);
  });

  it("stays at its end for values beyond", () => {
    expect(linear(0.5).toShare(2)).toBe(1);
    expect(decades(1e3, 1e7).toShare(1e9)).toBe(1);
  });
});
