import { describe, expect, it } from "vitest";
import { clock, count, DASH, dataSize, duration, fixed, plain, significant } from "./format";
import { readTyped } from "./number/typed";

describe("numbers", () => {
  it("keep their places and have one zero", () => {
    expect([1.005, -0.0004, -2, undefined, Number.NaN].map((n) => fixed(n, 2))).toEqual(["1.00", "0.00", "−2.00", DASH, DASH]);
    expect([0, 0.01234, 12.34, 1234, -0.5].map((n) => significant(n))).toEqual(["0", "0.0123", "12.3", "1234", "−0.500"]);
    expect(count(1234567)).toBe("1 234 567");
  });

  it("show durations in the unit that suits them", () => {
    expect([undefined, 5e-6, 0.0123, 2].map((s) => duration(s))).toEqual([
      { text: DASH, unit: "ms" }, { text: "5.00", unit: "µs" }, { text: "12.3", unit: "ms" }, { text: "2.00", unit: "s" },
    ]);
  });

  it("show what lies on a disk in the unit that suits it", () => {
    expect([0, 999, 1000, 12_345, 999_499, 999_501, 1_234_567, 5e9, 7.5e12].map(dataSize)).toEqual(
      ["0 B", "999 B", "1.00 kB", "12.3 kB", "999 kB", "1.00 MB", "1.23 MB", "5.00 GB", "7.50 TB"]);
  });

  it("show moments as a clock does", () => {
    expect([0, 9.9, 65, 3599.99, 3605, 36_000].map(clock)).toEqual(["0:00", "0:09", "1:05", "59:59", "1:00:05", "10:00:00"]);
  });

  it("stand in fields as they would be typed", () => {
    expect([0, 0.05, 2e5, 2e6, 1234567, 5e-4].map(plain)).toEqual(["0", "0.05", "200000", "2e6", "1.235e6", "5e-4"]);
    for (const value of [0.05, 2e5, 2e6, 5e-4]) {
      expect(readTyped(plain(value), { unit: "N", factor: 1 })).toMatchObject({ kind: "number", si: value });
    }
  });
});
