import { describe, expect, it } from "vitest";
import { CHANNELS, Channel } from "../../protocol/telemetry";
import { fakeHandState } from "../../state/fake_hand";
import { fakeSession } from "../../state/fake_session";
import { History } from "../../state/history";
import { arrowScale } from "./arrow_scale";
import { blockOf, inClay, othersOf, poseOfHand } from "./moment";

describe("a moment", () => {
  it("puts the handle where it would have the tool", () => {
    const session = fakeSession({ position_ratio: 0.5 });
    const tool = { ...session.tools[0], home_m: [0, 0.032, 0.01] as [number, number, number] };
    expect(inClay(session, tool, [0.02, -0.01, 0])).toEqual([0.01, 0.027, 0.01]);
  });

  it("draws a spring from the tool to a hand that holds it, and to no other", () => {
    const session = fakeSession({ position_ratio: 2 });
    const state = fakeHandState({ hand_m: [0.03, 0, 0], handle_m: [0.01, 0, 0], tool_m: [0.02, 0, 0], felt_force_n: [-1, 0, 0] });
    const drawn = (grasp: typeof state.grasp): unknown => poseOfHand(session, session.tools[0], { ...state, grasp }, [-2, 0, 0]);
    const pose = { tool_m: [0.02, 0, 0], handle_m: [0.06, 0, 0], toolForce_n: [-2, 0, 0], feltForce_n: [-1, 0, 0], isHeldHere: true };
    expect(drawn("held")).toEqual(pose);
    for (const grasp of ["released", "clutched", "waiting", "stopped"] as const) expect(drawn(grasp)).toEqual({ ...pose, handle_m: [0.02, 0, 0] });
  });

  it("knows where the tools of others are, from telemetry where there is any, and leaves out whoever has gone", () => {
    const one = fakeSession().tools[0];
    const tools = [1, 2, 3, 4].map((id) => ({ ...one, id, connected: id !== 4, position_m: [id, 0, 0] as [number, number, number] }));
    const session = fakeSession({ tools });
    const told = new History();
    const values = new Float32Array(2 * CHANNELS);
    values.set([0.5, 0.25, 0.125], Channel.tool_position_m);
    values.set([0.75, 0.25, 0.125], CHANNELS + Channel.tool_position_m);
    told.append({ sequence: 0, tool: 3, period_us: 1000, dropped: 0, first_time_s: 7, values });
    const places = othersOf(session, session.tools[0], (id) => (id === 3 ? told : new History()), 7.0005);
    expect(places[0]).toEqual([2, 0, 0]);
    expect(places[1][0]).toBeCloseTo(0.625, 6);
    expect(places.length).toBe(2);
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
