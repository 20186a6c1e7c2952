import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { complex, type Complex, exp, plus, scaled, times, valueAt } from "./complex";
import { characteristic, type Characteristic, type DelayedScheme, fastestGrowth, growingRoots, loopGain, type LoopParts } from "./loop";

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
const loopOf = (reference: Case): LoopParts => ({ ...reference, g_h: rational(reference.g_h), c_h1: rational(reference.c_h1) });

/** Every loop of the reference that has a margin, with it. */
const MARGINS = CASES.flatMap((reference) => (["force_exchange", "position_force"] as const).flatMap((scheme: DelayedScheme) => {
  const margin_s = reference[`delay_margin_${scheme}_s`];
  return reference.stable_without_delay && margin_s !== null ? [{ polynomials: characteristic(scheme, loopOf(reference)), margin_s, scheme }] : [];
}));

describe("a loop under delay", () => {
  it("grows above the reference's margin and not below it, for both schemes", () => {
    expect(new Set(MARGINS.map(({ scheme }) => scheme)).size).toBe(2);
    for (const { polynomials, margin_s } of MARGINS) {
      expect(fastestGrowth(polynomials, 0.97 * margin_s)).toBeUndefined();
      expect(fastestGrowth(polynomials, 1.1 * margin_s)).toBeDefined();
    }
  });

  it("swings at the margin with the frequency at which the loop gain is -1", () => {
    for (const { polynomials, margin_s } of MARGINS) {
      const growth = fastestGrowth(polynomials, 1.02 * margin_s);
      if (growth === undefined) continue; // so slow that it does not count yet
      const gain = loopGain(polynomials, margin_s, 2 * Math.PI * growth.frequency_hz);
      expect(Math.hypot(gain.re + 1, gain.im)).toBeLessThan(0.1);
    }
  });

  it("is seen whole: as many growing motions as the argument principle counts", () => {
    for (const { polynomials, margin_s } of MARGINS) {
      for (const factor of [0.5, 1.2, 2, 6]) {
        const delay_s = factor * margin_s;
        const roots = growingRoots(polynomials, delay_s);
        const pairs = roots.reduce((count, { im }) => count + (im === 0 ? 1 : 2), 0);
        expect(pairs).toBe(rootsRightOf(polynomials, delay_s, 0.01));
      }
    }
  });

  it("stays calm at any delay where the reference knows no margin", () => {
    const calm = CASES.filter((reference) => reference.stable_without_delay && reference.delay_margin_position_force_s === null);
    expect(calm.length).toBeGreaterThan(0);
    for (const reference of calm) {
      for (const delay_s of [0, 0.1, 1]) expect(fastestGrowth(characteristic("position_force", loopOf(reference)), delay_s)).toBeUndefined();
    }
  });
});

/** Turns of the characteristic function's value around 0, along a half circle far out and the line at `shift`. */
function rootsRightOf(polynomials: Characteristic, delay_s: number, shift: number): number {
  const radius = 2000;
  const at = (s: Complex): Complex =>
    plus(valueAt(polynomials.a, s), times(valueAt(polynomials.b, s), exp(scaled(s, -delay_s))));
  const points: Complex[] = [];
  const steps = 40_000;
  for (let n = 0; n <= steps; n += 1) {
    const angle = -Math.PI / 2 + (Math.PI * n) / steps;
    points.push(complex(shift + radius * Math.cos(angle), radius * Math.sin(angle)));
  }
  // Down the line, finer near the middle, where all that matters lies.
  for (let n = 0; n <= steps; n += 1) {
    const t = 1 - (2 * n) / steps;
    points.push(complex(shift, radius * t ** 3));
  }
  let turned = 0;
  let last = at(points[points.length - 1]);
  for (const point of points) {
    const value = at(point);
    turned += Math.atan2(last.re * value.im - last.im * value.re, last.re * value.re + last.im * value.im);
    last = value;
  }
  return Math.round(turned / (2 * Math.PI)) + 0; // no -0
}
