import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import { builtMathematics } from "../protocol/built_module";
import type { MathematicsModule } from "../protocol/mathematics";
import { loopOf, type LoopParts } from "./loop";

type Fraction = [number[], number[]];
interface Case {
  g_h: Fraction;
  c_h1: Fraction;
  t_h: number[];
  position_ratio: number;
  force_ratio: number;
  clay_damping_n_s_per_m: number;
  clay_stiffness_n_per_m: number;
  stable_without_delay: boolean;
  delay_margin_force_exchange_s: number | null;
  delay_margin_position_force_s: number | null;
}

const CASES = JSON.parse(readFileSync(`${import.meta.dirname}/../../../crates/control/tests/reference/loops.json`, "utf8")) as Case[];
const rational = ([numerator, denominator]: Fraction): LoopParts["g_h"] => ({ numerator, denominator });
const partsOf = (reference: Case): LoopParts => ({ ...reference, g_h: rational(reference.g_h), c_h1: rational(reference.c_h1) });

let module: MathematicsModule;
beforeAll(async () => {
  module = await builtMathematics();
});

describe("a loop under delay", () => {
  it("grows above the reference's margin and not below it, for both schemes, as the module finds it for the page", () => {
    const asked = { force_exchange: 0, position_force: 0 };
    for (const reference of CASES) {
      const loop = loopOf(module, partsOf(reference));
      if (loop === undefined) throw new Error("the reference's loop is refused");
      for (const scheme of ["force_exchange", "position_force"] as const) {
        const margin_s = reference[`delay_margin_${scheme}_s`];
        if (!reference.stable_without_delay || margin_s === null) continue;
        asked[scheme] += 1;
        const [below, above] = [0.97, 1.1].map((share) => loop.outlook(scheme, share * margin_s));
        expect(below.growth).toBeUndefined();
        expect(above.growth?.rate_per_s).toBeGreaterThan(0);
        expect(above.peakGain).toBeGreaterThanOrEqual(0.999 * (above.growth?.gain ?? Number.NaN));
      }
    }
    expect(Math.min(asked.force_exchange, asked.position_force)).toBeGreaterThan(0);
  });

  /** With an arm and no spring in it the gain is B_t s P / (1 + P T_h): worked out here, at a few frequencies. */
  it("has the gain that its parts have, turned by the delay", () => {
    const parts: LoopParts = {
      g_h: { numerator: [1], denominator: [1] }, c_h1: { numerator: [1], denominator: [2, 3, 0] }, t_h: [0.5],
      position_ratio: 1, force_ratio: -1, clay_damping_n_s_per_m: 4, clay_stiffness_n_per_m: 0,
    };
    const { omega_rad_s, re, im } = loopOf(module, parts)?.curve("position_force", 0.2) ?? { omega_rad_s: [], re: [], im: [] };
    expect(omega_rad_s.length).toBeGreaterThan(1000);
    expect([re.length, im.length]).toEqual([omega_rad_s.length, omega_rad_s.length]);
    for (let n = 0; n < omega_rad_s.length; n += 97) {
      const w = omega_rad_s[n];
      // 4 j w / (0.5 - 2 w² + 3 j w)
      const size = (4 * w) / Math.hypot(0.5 - 2 * w * w, 3 * w);
      const phase = Math.PI / 2 - Math.atan2(3 * w, 0.5 - 2 * w * w) - 0.2 * w;
      expect(re[n]).toBeCloseTo(size * Math.cos(phase), 9);
      expect(im[n]).toBeCloseTo(size * Math.sin(phase), 9);
    }
  });

  it("is kept apart from other loops, and is nothing where its parts make none", () => {
    const [first, second] = CASES.filter(({ stable_without_delay }) => stable_without_delay).slice(1).map((reference) => loopOf(module, partsOf(reference)));
    const before = first?.outlook("position_force", 0.1);
    expect(second?.outlook("position_force", 0.1)).not.toEqual(before);
    expect(first?.outlook("position_force", 0.1)).toEqual(before);
    expect(loopOf(module, { ...partsOf(CASES[0]), force_ratio: 1 })).toBeUndefined();
    expect(loopOf(module, { ...partsOf(CASES[0]), g_h: { numerator: [1], denominator: [] } })).toBeUndefined();
    expect(first?.outlook("position_force", 0.1)).toEqual(before);
  });
});
