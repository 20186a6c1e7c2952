import { describe, expect, it } from "vitest";
import type { Session } from "../../protocol/session";
import { fakeSession } from "../../state/fake_session";
import { liveFig7 } from "./figure";
import { type LivePath, passageOf, rangesOfSession, startOf, theoryAt } from "./passing";

const SESSION = fakeSession();
const STEPPED: Session = {
  ...SESSION,
  tool: { kind: "blade", width_m: 0.01, height_m: 0.04, thickness_m: 0.002 },
  material: { viscosity_pa_s_per_m: 2e5, yield_stress_pa: 0, stiffness_pa: 0 },
  clay: {
    ...SESSION.clay,
    shape: { kind: "stepped", edges_m: [0.03, 0.06, 0.09], depths_of_cut_m: [0.01, 0.02], base_m: 0.01, width_m: 0.064 },
  },
};
const LAW = { virtual_damping_n_s_per_m: 10, position_ratio: 1, force_ratio: 1 };

/** One sample a millimetre, there and back again, at `v` on the way there. */
function there(v: number, force_n: number, height_m = 0.01): LivePath {
  const forth = Array.from({ length: 121 }, (_, n) => n / 1000);
  const position_m = [...forth, ...forth.toReversed()];
  return {
    position_m,
    velocity_m_s: position_m.map((_, n) => (n < 121 ? v : -2 * v)),
    hand_force_n: position_m.map((_, n) => (n < 121 ? force_n : -force_n)),
    height_m: position_m.map(() => height_m),
  };
}

describe("Fig. 7 from a session", () => {
  it("has the ranges of a stepped block under a blade, and none otherwise", () => {
    expect(rangesOfSession(STEPPED).map(({ from_m, to_m }) => [from_m, to_m])).toEqual([[0.03, 0.06], [0.06, 0.09]]);
    expect(rangesOfSession({ ...STEPPED, position_ratio: 2 })[0].from_m).toBe(0.015);
    expect(rangesOfSession({ ...STEPPED, tool: { kind: "ball", radius_m: 0.006 } })).toEqual([]);
    expect(rangesOfSession({ ...STEPPED, clay: { ...STEPPED.clay, shape: { kind: "block", size_m: [0.1, 0.1, 0.1] } } })).toEqual([]);
  });

  it("counts positions from where the block begins", () => {
    expect(startOf({ ...STEPPED, position_ratio: 2 }, { ...STEPPED.tools[0], home_m: [0.02, 0.032, 0.01] })).toBe(-0.01);
  });

  it("takes the last third of the way there, not the way back", () => {
    const [first, second] = rangesOfSession(STEPPED).map((range) => passageOf(range, there(0.05, 2), LAW));
    expect(first.measured_m_s).toBeCloseTo(0.05, 12);
    expect(first.hand_force_n).toBeCloseTo(2, 12);
    // B_i = k A = 2e5 · 1 cm · 1 cm = 20 N·s/m, then twice that.
    expect(first.theory_m_s).toBeCloseTo(2 / (10 + 20), 12);
    expect(second.theory_m_s).toBeCloseTo(2 / (10 + 40), 12);
  });

  it("knows how deep the blade was, and says nothing before there was a passage", () => {
    const [range] = rangesOfSession(STEPPED);
    expect(passageOf(range, there(0.05, 2, 0.015), LAW).engaged_area_m2).toBeCloseTo(0.01 * 0.005, 12);
    expect(passageOf(range, { position_m: [], velocity_m_s: [], hand_force_n: [], height_m: [] }, LAW).measured_m_s).toBeUndefined();
  });

  it("counts ratios and a yield stress into the theory", () => {
    // B v = f_h - (sigma A + k A A_h1 v) / |A_h2|
    const clay = { viscosity_pa_s_per_m: 2e5, yield_stress_pa: 1000 };
    const law = { virtual_damping_n_s_per_m: 10, position_ratio: 3, force_ratio: 2 };
    const v = theoryAt(2, 1e-4, clay, law);
    expect(10 * v).toBeCloseTo(2 - (1000 * 1e-4 + 2e5 * 1e-4 * 3 * v) / 2, 12);
    expect(theoryAt(0.01, 1e-4, clay, law)).toBe(0);
  });

  it("draws theory only where there was a passage", () => {
    const path = there(0.05, 2);
    const short = { ...path, position_m: path.position_m.map((x) => Math.min(x, 0.07)) };
    const passages = rangesOfSession(STEPPED).map((range) => passageOf(range, short, LAW));
    const { lines, bands } = liveFig7(short, passages);
    expect(bands?.length).toBe(2);
    expect(lines.map(({ colour }) => colour)).toEqual(["--hand", "--text"]);
    expect(lines[1].x.filter((_, n) => Number.isFinite(lines[1].y[n]))).toEqual([3, 6]);
  });
});
