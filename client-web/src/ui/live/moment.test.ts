import { describe, expect, it } from "vitest";
import { fakeSession } from "../../state/fake_session";
import { arrowScale } from "./arrow_scale";
import { blockOf, inClay } from "./moment";

describe("a moment", () => {
  it("puts the handle where it would have the tool", () => {
    const session = fakeSession({ position_ratio: 0.5 });
    const tool = { ...session.tools[0], home_m: [0, 0.032, 0.01] as [number, number, number] };
    expect(inClay(session, tool, [0.02, -0.01, 0])).toEqual([0.01, 0.027, 0.01]);
  });

  it("knows the faces of a fresh block", () => {
    expect(blockOf({ kind: "block", size_m: [0.128, 0.064, 0.05] })).toEqual({
      size_m: [0.128, 0.064, 0.05], heights_m: [0.05], steps_m: [0, 0.128],
    });
    const stepped = blockOf({ kind: "stepped", edges_m: [0.03, 0.06, 0.09], depths_of_cut_m: [0.01, 0.03], base_m: 0.01, width_m: 0.064 });
    expect(stepped.size_m).toEqual([0.09, 0.064, 0.04]);
    expect(stepped.heights_m).toEqual([0.02, 0.04]);
    expect(stepped.steps_m).toEqual([0.03, 0.06, 0.09]);
  });

  it("draws the greatest force as an arrow that is seen and stays in view", () => {
    for (const force_n of [0.3, 1, 2.2, 7, 20]) {
      const length_mm = arrowScale(force_n, 0.1) * force_n;
      expect(length_mm).toBeGreaterThan(14);
      expect(length_mm).toBeLessThanOrEqual(45);
    }
    expect(Number.isFinite(arrowScale(0, 0))).toBe(true);
  });
});
