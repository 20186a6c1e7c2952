import { describe, expect, it } from "vitest";
import { outOfRange, readTyped, say, type Unit } from "./typed";
import { perUnit } from "./units";

const MS: Unit = { unit: "ms", factor: 1e3 };
const PERCENT: Unit = { unit: "%", factor: 100 };
const MM: Unit = { unit: "mm", factor: 1e3 };
const NEWTON: Unit = { unit: "N", factor: 1 };
const VISCOSITY: Unit = { unit: "kPa·s/m", factor: 1e-3 };
const STIFFNESS: Unit = { unit: "MPa", factor: 1e-6 };
const DAMPING: Unit = { unit: "N·s/m", factor: 1 };
const RATIO: Unit = { unit: "tool/hand", factor: 1 };
const DEGREE: Unit = { unit: "°", factor: 180 / Math.PI };

/** What is read, in SI; the reason when nothing is. */
const read = (text: string, unit: Unit = MS): number | string => {
  const typed = readTyped(text, unit);
  return typed.kind === "number" ? typed.si : typed.reason;
};

describe("a typed number", () => {
  // In a field of milliseconds, as seconds.
  it.each([
    ["30", 0.03], ["0", 0], ["-0", 0], ["+30", 0.03], ["-30", -0.03], ["0.5", 5e-4], [".5", 5e-4], ["5.", 5e-3], ["007", 7e-3],
    // A comma for the point.
    ["0,5", 5e-4], [",5", 5e-4], ["5,", 5e-3], ["12,34", 0.01234], ["1,5000", 1.5e-3], ["0,500", 5e-4], ["1234,567", 1.234567],
    // A point is a point, whatever stands behind it: that is how the page writes.
    ["1.500", 1.5e-3], ["12.345", 0.012345],
    // Thousands, where nothing else can be meant.
    ["1 500", 1.5], ["12 345 678", 12345.678], ["1'500", 1.5], ["1’500.25", 1.50025], ["1,500.25", 1.50025], ["1.500,25", 1.50025],
    ["1 500,25", 1.50025], ["1 500,250", 1.50025], ["1,500,000", 1500], ["1.500.000", 1500], ["1,500,000.5", 1500.0005], ["1,500.", 1.5],
    // Powers of ten.
    ["2e3", 2], ["2E3", 2], ["2e+3", 2], ["2e-3", 2e-6], ["2,5e3", 2.5], ["2·10^3", 2], ["2×10³", 2], ["2 * 10^-3", 2e-6], ["2x10⁺³", 2],
    // Other minus signs.
    ["−30", -0.03], ["–30", -0.03], ["—30", -0.03], ["‐30", -0.03], ["﹣30", -0.03], ["－30", -0.03], ["− 30", -0.03], ["2e−3", 2e-6],
    // Full width, and what is copied along.
    ["３０", 0.03], ["３０．５", 0.0305], ["－３０", -0.03], ["\u00a030\u00a0", 0.03], ["1\u00a0500", 1.5], ["1\u202f500", 1.5], ["1\u2009500", 1.5],
    ["\u200b30\ufeff", 0.03], ["\t30\n", 0.03], ["\u3000３０", 0.03], ["\u202a30\u202c", 0.03],
    // Units.
    ["30 ms", 0.03], ["30ms", 0.03], ["30\u00a0ms", 0.03], ["0.03 s", 0.03], ["3 s", 3], ["3sec", 3], ["30000 µs", 0.03], ["30000 μs", 0.03],
    ["30000us", 0.03], ["30 MS", 0.03], ["1 min", 60], ["2e3 ms", 2], ["3０ ｍｓ", 0.03], ["1 500 ms", 1.5],
  ])("%j is %d s in a field of ms", (text, si) => {
    expect(read(text)).toBe(si);
  });

  it.each([
    ["1,500", "“1,500” could mean 1.5 or 1500: write 1.5 or 1500"],
    ["12,340", "“12,340” could mean 12.34 or 12340: write 12.34 or 12340"],
    ["999,999", "“999,999” could mean 999.999 or 999999: write 999.999 or 999999"],
    ["-1,500", "“-1,500” could mean -1.5 or -1500: write -1.5 or -1500"],
    ["1,500 s", "“1,500 s” could mean 1.5 s or 1500 s: write 1.5 s or 1500 s"],
    ["１，５００", "“１，５００” could mean 1.5 or 1500: write 1.5 or 1500"],
    ["", "a number is missing"], ["   ", "a number is missing"], ["\u00a0\u200b", "a number is missing"],
    ["∞", "“∞” is not a finite number"], ["-∞", "“-∞” is not a finite number"], ["Infinity", "“Infinity” is not a finite number"],
    ["-inf", "“-inf” is not a finite number"], ["NaN", "“NaN” is not a finite number"],
    ["1e999", "“1e999” is too large"],
    ["abc", "“abc” is not a number"], ["ms", "“ms” is not a number"], ["-", "“-” is not a number"], [".", "“.” is not a number"],
    ["1.2.3", "“1.2.3” is not a number"], ["1,2,3", "“1,2,3” is not a number"], ["1,5,", "“1,5,” is not a number"],
    ["12,34,567", "“12,34,567” is not a number"], ["1 5", "“1 5” is not a number"], ["1 50 000", "“1 50 000” is not a number"],
    ["1,500 000", "“1,500 000” is not a number"], ["1.500,000.5", "“1.500,000.5” is not a number"], ["--3", "“--3” is not a number"],
    ["3-4", "“3-4” is not a number"], ["1e", "“1e” is not in ms"], ["1e5.5", "“1e5.5” is not a number"], ["1_000", "“1_000” is not a number"],
    ["0x10", "“0x10” is not a number"], ["½", "“½” is not a number"], ["٣", "“٣” is not a number"], ["10²", "“10²” is not a number"],
    ["30 mm", "“30 mm” is not in ms"], ["30 N", "“30 N” is not in ms"], ["30 %", "“30 %” is not in ms"], ["30 parsec", "“30 parsec” is not in ms"],
  ])("%j is refused: %s", (text, reason) => {
    expect(read(text)).toBe(reason);
  });

  it("is read in the unit of its field, or the one behind it", () => {
    expect([read("5", PERCENT), read("5 %", PERCENT), read("5 percent", PERCENT), read("7‰", PERCENT)]).toEqual([0.05, 0.05, 0.05, 0.007]);
    expect([read("6.4", MM), read("6.4mm", MM), read("0.64 cm", MM), read("0,0064 m", MM), read("6400 µm", MM)]).toEqual(Array(5).fill(0.0064));
    expect([read("2", NEWTON), read("2 N", NEWTON), read("2000 mN", NEWTON), read("0.002 kN", NEWTON)]).toEqual(Array(4).fill(2));
    const viscosities = ["200", "200 kPa s/m", "200 kPa·s/m", "200 kPa*s/m", "200kPas/m", "0.2 MPa·s/m", "2e5 Pa·s/m"];
    expect(viscosities.map((text) => read(text, VISCOSITY))).toEqual(Array(7).fill(2e5));
    expect([read("2", STIFFNESS), read("2 MPa", STIFFNESS), read("2000 kPa", STIFFNESS), read("2e6 Pa", STIFFNESS)]).toEqual(Array(4).fill(2e6));
    expect([read("20", DAMPING), read("20 Ns/m", DAMPING), read("20 N s/m", DAMPING), read("20 kg/s", DAMPING)]).toEqual(Array(4).fill(20));
    expect([read("90", DEGREE), read("90°", DEGREE), read("90 deg", DEGREE)]).toEqual(Array(3).fill(Number((Math.PI / 2).toPrecision(12))));
    expect([read("2", RATIO), read("2 tool/hand", RATIO), read("2 mm", RATIO)]).toEqual([2, 2, "“2 mm” is more than a number"]);
  });

  it("does not take one unit for another that differs in its capitals", () => {
    // Millipascals are in no table; nobody may get megapascals for them.
    expect(perUnit("MPa", "MPa")).toBe(1e6);
    expect(read("2 mN", NEWTON)).toBe(0.002);
    expect(read("2 KN", NEWTON)).toBe(2000);
    expect(read("2 Kpa", STIFFNESS)).toBe(2000);
  });

  it("is told back in the unit that was typed", () => {
    const told = (text: string, unit: Unit, least: number, greatest: number): string => {
      const typed = readTyped(text, unit);
      if (typed.kind !== "number") throw new Error(typed.reason);
      return outOfRange(typed.si, least, greatest, typed.unit);
    };
    expect(told("3000", MS, 0, 2)).toBe("3000 ms is not from 0 to 2000 ms");
    expect(told("3000 ms", MS, 0, 2)).toBe("3000 ms is not from 0 to 2000 ms");
    expect(told("3 s", MS, 0, 2)).toBe("3 s is not from 0 to 2 s");
    expect(told("−1", MS, 0, 2)).toBe("−1 ms is not from 0 to 2000 ms");
    expect(told("120", PERCENT, 0, 1)).toBe("120 % is not from 0 to 100 %");
    expect(told("2e4", VISCOSITY, 0, 1e7)).toBe("20000 kPa·s/m is not from 0 to 10000 kPa·s/m");
    expect(told("5000", RATIO, 1e-3, 1e3)).toBe("5000 is not from 0.001 to 1000");
    expect(told("2000.00001", MS, 0, 2)).toBe("2000.00001 ms is not from 0 to 2000 ms");
    expect(told("1e20", NEWTON, 1e-3, 100)).toBe("1e20 N is not from 0.001 to 100 N");
  });

  it("survives being told and typed again, in every unit", () => {
    for (const unit of [MS, PERCENT, MM, NEWTON, VISCOSITY, STIFFNESS, DAMPING, RATIO]) {
      for (const si of [0, 1, -2.5, 1e-6, 0.123456789, 98765.4321, 2e5, 1e9, 3e-9]) {
        expect(read(say(si, unit), unit)).toBeCloseTo(si, 12 - Math.ceil(Math.log10(Math.abs(si) + 1)));
      }
    }
  });
});
