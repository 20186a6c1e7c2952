import { describe, expect, it } from "vitest";
import { AutoRange, roundStep } from "./range";

describe("a live range", () => {
  it("grows at once, holds everything, and ends on round numbers", () => {
    const range = new AutoRange(0.1);
    const [low, high] = range.update(-1.3, 7.9);
    expect(low).toBeLessThanOrEqual(-1.3);
    expect(high).toBeGreaterThanOrEqual(7.9);
    expect(low % 1).toBeCloseTo(0);
    expect(high - low).toBeLessThan(2 * 9.2);
  });

  it("holds still while the data wanders within it, and shrinks when it stays small", () => {
    const range = new AutoRange(0.1);
    const wide = range.update(-10, 10);
    for (let n = 0; n < 20; n += 1) expect(range.update(-1, 1)).toEqual(wide);
    for (let n = 0; n < 100; n += 1) range.update(-1, 1);
    const [low, high] = range.update(-1, 1);
    expect(high - low).toBeLessThan((wide[1] - wide[0]) / 4);
  });

  it("fits at once where the plot stands still", () => {
    const range = new AutoRange(0.1);
    range.update(-10, 10);
    const [low, high] = range.settle(1, 2);
    expect([low <= 1, 2 <= high, high - low < 3]).toEqual([true, true, true]);
    expect(range.settle(Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY)).toEqual([low, high]);
  });

  it("does not blow noise up, and passes over what is not a number", () => {
    const range = new AutoRange(2);
    const [low, high] = range.update(5.0001, 5.0002);
    expect(high - low).toBeGreaterThanOrEqual(2);
    expect(range.update(Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY)).toEqual([low, high]);
  });

  it("steps by 1, 2 or 5 times a power of ten", () => {
    expect([0.11, 0.2, 0.3, 7, 10, 4e-3].map(roundStep).map((step) => Number(step.toPrecision(6)))).toEqual([0.2, 0.2, 0.5, 10, 10, 5e-3]);
  });
});
