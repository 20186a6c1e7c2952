import { describe, expect, it } from "vitest";
import type { LatencyCell } from "../../protocol/latency";
import { decodeLatencyTable } from "../../protocol/text";
import { jittersOf, layOut, profilesOf } from "./grid";
import { badness, MEASURES, shortText } from "./measures";

const CELL: LatencyCell = {
  scheme: "replica", one_way_delay_s: 0.05, jitter_ratio: 0.2, loss: 0.01, profile: "iid", seeds: 30, stable: true,
  min_energy_j: 1e-5, force_nrmse: 0.004, position_rmse_m: 2e-4, coordination_rmse_m: 3e-4, removed_volume_error: 0,
  share_force_error_above_jnd: 0.001, correction_step_n: { p50: 0, p95: 0.01, p99: 0.02 }, clay_identical: true,
  packets_per_s: 2000, bytes_per_s: 120_000,
};
/** As a run that came apart writes it. */
const APART: LatencyCell = {
  ...CELL, scheme: "position_force", stable: false, min_energy_j: -3, force_nrmse: null, position_rmse_m: null,
  removed_volume_error: null, correction_step_n: null, clay_identical: null,
};

describe("the latency table", () => {
  it("is read as teleclay-latency writes it", () => {
    const text = JSON.stringify({
      wall: [{ rtt_s: 0.01, mass_kg: 0.1, damping_n_s_per_m: 2, critical_stiffness_n_per_m: 300, measured_stiffness_n_per_m: 299 }],
      cells: [CELL, APART],
    });
    expect(decodeLatencyTable(text).cells).toEqual([CELL, APART]);
  });

  it("has a grid per scheme in the switch's order, delays and losses ascending, gaps as gaps", () => {
    const cells = [
      { ...CELL, scheme: "mystery" }, { ...CELL, one_way_delay_s: 0.25 }, CELL, { ...CELL, loss: 0.3 }, APART,
      { ...CELL, jitter_ratio: 0.5 }, { ...CELL, profile: "bursts" as const },
    ];
    const table = { wall: [], cells };
    const { delays_s, losses, grids } = layOut(table, { jitter_ratio: 0.2, profile: "iid" });
    expect(delays_s).toEqual([0.05, 0.25]);
    expect(losses).toEqual([0.01, 0.3]);
    expect(grids.map(({ scheme }) => scheme)).toEqual(["position_force", "replica", "mystery"]);
    expect(grids[1].rows).toEqual([[CELL, { ...CELL, one_way_delay_s: 0.25 }], [{ ...CELL, loss: 0.3 }, undefined]]);
    expect(jittersOf(table, "iid")).toEqual([0.2, 0.5]);
    expect(profilesOf(table)).toEqual(["iid", "bursts"]);
  });

  it("calls a run that came apart as bad as can be, and grades the rest by decades", () => {
    const [force] = MEASURES;
    expect(badness(force, APART)).toBe(1);
    expect(badness(force, { ...CELL, force_nrmse: 0.01 })).toBe(0);
    expect(badness(force, { ...CELL, force_nrmse: 0.1 })).toBeCloseTo(0.5);
    expect(badness(force, { ...CELL, force_nrmse: 0 })).toBe(0);
    expect(badness(force, { ...CELL, stable: false })).toBe(1);
    expect(badness(force, { ...CELL, force_nrmse: null })).toBeUndefined();
  });

  it("counts energy that the link made, not what it took", () => {
    const energy = MEASURES.find(({ key }) => key === "min_energy_j");
    expect(energy?.value(CELL)).toBe(0);
    expect(energy?.value(APART)).toBe(3000);
  });

  it("fits numbers into cells", () => {
    expect([undefined, 0, 0.004, 0.123, 4.56, 45.6, 456, 45_600].map(shortText)).toEqual(["–", "0", "4e−3", "0.12", "4.6", "46", "456", "5e4"]);
  });
});
