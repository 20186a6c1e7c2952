import { describe, expect, it } from "vitest";
import type { CuttingAnswer } from "../../protocol/theory";
import { fig7 } from "./figure";
import { PAPER, rangesOf, request, settings, withoutRange, withRange } from "./model";
import { plateaus, plateausCsv, traceCsv } from "./table";

const ANSWER: CuttingAnswer = {
  plateau_velocity_m_s: [0.0666, 0.04, 0.0286],
  simulated_velocity_m_s: [0.0666, 0.0404, 0.0286],
  ripple: [0.001, 0.002, 0.003],
  window_m: [[0.05, 0.06], [0.08, 0.09], [0.11, 0.12]],
  engaged_area_m2: [1e-4, 2e-4, 3e-4],
  duration_s: 2.27,
  removed_volume_m3: 1.8e-5,
  specimen: { voxel_size_m: 5e-4, viscosity_pa_s_per_m: 2e5, blade_width_m: 0.01, depth_of_cut_m: [0.01, 0.02, 0.03] },
  trace: { t_s: [0, 0.001], position_m: [0.03, 0.031], velocity_m_s: [0, 0.01], hand_force_n: [2, 2], tool_force_n: [0, -0.2] },
};

describe("the cutting experiment", () => {
  it("asks for the paper's own, with the clay's sign", () => {
    settings.value = PAPER;
    expect(request.value).toMatchObject({ hand_force_n: 2, force_ratio: -1, position_ratio: 1, edges_m: [0.03, 0.06, 0.09, 0.12] });
  });

  it("knows the theory: f_h / (B + rho B_i)", () => {
    const theory = rangesOf({ ...request.value, position_ratio: 2, force_ratio: -0.5 }).map(({ theory_m_s }) => theory_m_s);
    // rho = 4
    expect(theory).toEqual([2 / (10 + 80), 2 / (10 + 160), 2 / (10 + 240)]);
  });

  it("gains and loses ranges without losing its order", () => {
    const longer = withRange(PAPER);
    expect(longer.edges_m).toEqual([0.03, 0.06, 0.09, 0.12, 0.15]);
    expect(longer.clay_damping_n_s_per_m).toEqual([20, 40, 60, 80]);
    expect(withoutRange(longer)).toEqual(PAPER);
  });

  it("draws the theory as levels that nothing joins, over the measurement", () => {
    const now = request.value;
    const { lines, marks } = fig7(now, now, ANSWER);
    expect(lines.map(({ colour }) => colour)).toEqual(["--tool", "--text"]);
    expect(lines[1].x.filter((_, n) => Number.isFinite(lines[1].y[n]))).toEqual([3, 6, 6, 9, 9, 12]);
    expect(marks?.map(({ text }) => text)).toEqual(["6.66 cm/s", "4.00 cm/s", "2.86 cm/s"]);
  });

  it("tables the deviation, and writes files that another program reads", () => {
    const rows = plateaus(request.value, ANSWER);
    expect(rows.map(({ deviation }) => deviation.toFixed(4))).toEqual(["0.0000", "0.0100", "0.0000"]);
    const [head, first, ...rest] = plateausCsv(rows).split("\r\n");
    expect(head.split(",").length).toBe(first.split(",").length);
    expect(first.startsWith("0.03,0.06,20,0.0666,0.0666,")).toBe(true);
    expect(rest).toHaveLength(3);
    expect(traceCsv(ANSWER.trace)).toBe("t_s,position_m,velocity_m_s,hand_force_n,tool_force_n\r\n0,0.03,0,2,0\r\n0.001,0.031,0.01,2,-0.2\r\n");
  });
});
