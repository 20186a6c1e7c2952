// A session as the server describes it, and what can be asked of it. SI units. Fields this page does not know are passed
// over, so that a newer server can add some.

import * as v from "valibot";

const vector = v.tuple([v.number(), v.number(), v.number()]);

export const SCHEMES = ["force_exchange", "position_force", "wave", "tdpa", "replica"] as const;
const scheme = v.picklist(SCHEMES);

const material = v.object({
  viscosity_pa_s_per_m: v.number(),
  yield_stress_pa: v.number(),
  stiffness_pa: v.number(),
});

const burst = v.object({ enter: v.number(), leave: v.number(), loss_in_burst: v.number() });
const outage = v.object({ every_s: v.number(), length_s: v.number() });

const impairment = v.object({
  delay_s: v.number(),
  jitter_s: v.number(),
  loss: v.number(),
  seed: v.number(),
  jitter_distribution: v.optional(v.picklist(["normal", "heavy_tailed"])),
  duplicate: v.optional(v.number()),
  reorder: v.optional(v.number()),
  burst: v.optional(burst),
  outage: v.optional(outage),
});

const network = v.object({ up: impairment, down: impairment });

/** `null` ends bursts or outages; left out, they stay. */
const impairmentPatch = v.partial(v.object({
  ...impairment.entries,
  burst: v.nullable(burst),
  outage: v.nullable(outage),
}));

const clayShape = v.variant("kind", [
  v.object({ kind: v.literal("block"), size_m: v.optional(vector) }),
  v.object({
    kind: v.literal("stepped"),
    edges_m: v.optional(v.array(v.number())),
    depths_of_cut_m: v.optional(v.array(v.number())),
    base_m: v.optional(v.number()),
    width_m: v.optional(v.number()),
  }),
]);

const toolShape = v.variant("kind", [
  v.object({ kind: v.literal("ball"), radius_m: v.number() }),
  v.object({ kind: v.literal("blade"), width_m: v.number(), height_m: v.number(), thickness_m: v.number() }),
]);

const quantiles = v.object({ p50: v.number(), p99: v.number() });

const toolState = v.object({
  id: v.number(),
  operator: v.string(),
  connected: v.boolean(),
  position_m: vector,
  force_n: vector,
  handle_position_m: vector,
  felt_force_n: vector,
  hand_force_n: vector,
  home_m: vector,
  copy: v.picklist(["none", "live", "stale", "diverged"]),
  hidden_force_n: vector,
  sweeps_refused: v.number(),
  corrections: v.object({
    count: v.number(),
    moved_n: v.number(),
    held_n: vector,
    largest_step_n: v.number(),
    injected_j: v.number(),
    tank_j: v.number(),
  }),
});

export const sessionSchema = v.object({
  id: v.string(),
  scheme,
  axes: v.picklist([2, 3]),
  state: v.picklist(["idle", "running", "paused", "fault"]),
  fault: v.nullable(v.string()),
  material,
  network,
  clay: v.object({
    voxel_size_m: v.number(),
    initial_volume_m3: v.number(),
    remaining_volume_m3: v.number(),
    removed_volume_m3: v.number(),
    initial_units: v.number(),
    remaining_units: v.number(),
    removed_units: v.number(),
    unit_volume_m3: v.number(),
    hash: v.string(),
    shape: clayShape,
    epoch: v.number(),
  }),
  tool: toolShape,
  deadband: v.number(),
  tools: v.array(toolState),
  position_ratio: v.number(),
  coordination_m: v.number(),
  loop: v.object({
    rate_hz: v.number(),
    ticks: v.number(),
    late_ticks: v.number(),
    tick_s: v.object({ p50: v.number(), p99: v.number(), p999: v.number(), max: v.number() }),
    rtt_s: quantiles,
    age_s: quantiles,
    lost: v.number(),
    duplicates: v.number(),
    reordered: v.number(),
    packets_up_per_s: v.number(),
    packets_down_per_s: v.number(),
    energy_j: v.number(),
    scheduler: v.string(),
  }),
});

/** RFC 9457 problem details. */
export const problemSchema = v.object({
  type: v.string(),
  title: v.string(),
  status: v.number(),
  detail: v.string(),
  pointer: v.optional(v.string()),
});

/** Changes of a session; what is left out keeps its value. */
export const patchSchema = v.object({
  scheme: v.optional(scheme),
  material: v.optional(v.partial(material)),
  network: v.optional(v.partial(v.object({ up: impairmentPatch, down: impairmentPatch }))),
  deadband: v.optional(v.number()),
  paused: v.optional(v.boolean()),
});

/** Asks for a fresh block; what is left out is as it was. */
export const clayResetSchema = v.object({ shape: v.optional(clayShape), material: v.optional(material) });

export type Scheme = v.InferOutput<typeof scheme>;
export type Material = v.InferOutput<typeof material>;
export type Impairment = v.InferOutput<typeof impairment>;
export type ClayShape = v.InferOutput<typeof clayShape>;
export type ToolShape = v.InferOutput<typeof toolShape>;
export type ToolState = v.InferOutput<typeof toolState>;
export type Session = v.InferOutput<typeof sessionSchema>;
export type Problem = v.InferOutput<typeof problemSchema>;
export type SessionPatch = v.InferOutput<typeof patchSchema>;
export type ClayReset = v.InferOutput<typeof clayResetSchema>;

/** What a session is made of, as far as this page makes any. */
export interface NewSession {
  readonly id: string;
  readonly tool?: ToolShape;
  readonly clay?: { readonly shape: ClayShape };
}
export type Vector = readonly [number, number, number];
