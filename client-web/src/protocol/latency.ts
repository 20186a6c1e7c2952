// The table that `teleclay-latency --json` writes. What a run could not measure, for it came apart, is null.

import * as v from "valibot";

const measured = v.nullable(v.number());

export const PROFILES = ["iid", "bursts", "outage", "second_writer"] as const;

const cell = v.object({
  /** A name of `SCHEMES`, or one that this page does not know. */
  scheme: v.string(),
  one_way_delay_s: v.number(),
  jitter_ratio: v.number(),
  loss: v.number(),
  profile: v.picklist(PROFILES),
  seeds: v.number(),
  /** Whether every seed's run was. */
  stable: v.boolean(),
  /** Share of the seeds whose run was. */
  stable_share: v.optional(v.number()),
  min_energy_j: measured,
  force_nrmse: measured,
  position_rmse_m: measured,
  coordination_rmse_m: measured,
  removed_volume_error: measured,
  share_force_error_above_jnd: measured,
  correction_step_n: v.nullable(v.object({ p50: measured, p95: measured, p99: measured })),
  /** Most that corrections brought into the hand. */
  injected_j: v.optional(measured),
  /** What a copy of the clay hid, over what was felt; null for schemes without one. */
  hidden_force_nrmse: v.optional(measured),
  clay_identical: v.nullable(v.boolean()),
  packets_per_s: measured,
  bytes_per_s: measured,
});

const wall = v.object({
  rtt_s: v.number(),
  mass_kg: v.number(),
  damping_n_s_per_m: v.number(),
  critical_stiffness_n_per_m: v.number(),
  measured_stiffness_n_per_m: measured,
});

export const latencyTableSchema = v.object({ wall: v.array(wall), cells: v.array(cell) });

export type LatencyCell = v.InferOutput<typeof cell>;
export type LatencyTable = v.InferOutput<typeof latencyTableSchema>;
export type WallRow = v.InferOutput<typeof wall>;
export type Profile = LatencyCell["profile"];
