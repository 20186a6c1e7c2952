import { describe, expect, it } from "vitest";
import { describeAt } from "./figures";
import { cursorAfter } from "./bode_keys";

const SPAN = [0.1, 1000] as const;

function after(keys: readonly string[], from?: number): number | undefined | "other" {
  return keys.reduce<number | undefined | "other">(
    (at, key) => cursorAfter({ key: key.replace("Shift+", ""), shiftKey: key.startsWith("Shift+") }, at === "other" ? undefined : at, SPAN),
    from,
  );
}

describe("the cursor of the Bode diagram", () => {
  it("begins in the middle, moves by a twentieth of a decade, and with shift by a tenth of that", () => {
    expect(after(["ArrowRight"])).toBeCloseTo(10, 9);
    expect(after(["ArrowRight", ...Array<string>(20).fill("ArrowRight")])).toBeCloseTo(100, 6);
    expect(after(["ArrowLeft", ...Array<string>(200).fill("Shift+ArrowLeft")])).toBeCloseTo(1, 6);
    expect(after(["PageDown"], 2)).toBeCloseTo(20, 9);
  });

  it("stays within what is drawn, and goes away", () => {
    expect(after(["End"], 3)).toBe(1000);
    expect(after(["End", "ArrowRight", "PageDown"], 3)).toBe(1000);
    expect(after(["Home", "PageUp"], 3)).toBe(0.1);
    expect(after(["Escape"], 3)).toBe(undefined);
    expect(after(["Enter"], 3)).toBe("other");
  });

  it("is read in words: an integrator at 10 rad/s has a tenth, a quarter of a turn late", () => {
    const omega_rad_s = [1, 10, 100];
    const curve = { omega_rad_s, re: [0, 0, 0], im: omega_rad_s.map((omega) => -1 / omega) };
    expect(describeAt(curve, 9)).toBe("10 rad/s = 1.6 Hz: -20.0 dB, -90°");
  });
});
