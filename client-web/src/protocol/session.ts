// A session as the server describes it, and what can be asked of it. SI units. Fields this page does not know are
// passed over, so that a newer server can add some.

import * as v from "valibot";
import type { Check, Schemas } from "./api";

export type Vector = Schemas["Vector"];
export type Scheme = Schemas["Scheme"];
export type Operation = Schemas["Operation"];
export type ClayShape = Schemas["ClayShape"];
export type ToolShape = Schemas["ToolDescription"];
export type ToolState = Schemas["ToolState"];
export type Problem = Schemas["Problem"];
export type NewSession = Schemas["NewSession"];
export type SessionPatch = Schemas["SessionPatch"];
export type ClayReset = Schemas["ClayReset"];

// What may be left out of a request, for it has a default, is there in an answer.
export type Material = Required<Schemas["Material"]>;
export type Impairment = Required<Omit<Schemas["Impairment"], "burst" | "outage">> & Pick<Schemas["Impairment"], "burst" | "outage">;
export type Session = Omit<Schemas["Session"], "material" | "network"> & {
  readonly material: Material;
  readonly network: { readonly up: Impairment; readonly down: Impairment };
};

export type Storage = Schemas["StorageReport"];

/** A session whose files on disk are damaged: it can be deleted, and nothing else. */
export interface DamagedSession {
  readonly id: string;
  readonly state: "damaged";
  readonly storage: Storage;
}

/** What a list of sessions has of each. */
export type SessionEntry = Session | DamagedSession;

export const isDamaged = (entry: SessionEntry): entry is DamagedSession => entry.state === "damaged";

export const vector = v.tuple([v.number(), v.number(), v.number()]) satisfies Check<"Vector">;

export const SCHEMES = ["force_exchange", "position_force", "wave", "tdpa", "replica"] as const satisfies readonly Scheme[];
export const scheme = v.picklist(SCHEMES) satisfies Check<"Scheme">;

export const OPERATIONS = ["cut", "add", "smooth"] as const satisfies readonly Operation[];
const operation = v.picklist(OPERATIONS) satisfies Check<"Operation">;

const material = v.object({
  viscosity_pa_s_per_m: v.number(),
  yield_stress_pa: v.number(),
  stiffness_pa: v.number(),
}) satisfies v.GenericSchema<unknown, Material>;

const burst = v.object({ enter: v.number(), leave: v.number(), loss_in_burst: v.number() }) satisfies Check<"Burst">;
const outage = v.object({ every_s: v.number(), length_s: v.number() }) satisfies Check<"Outage">;

const impairment = v.object({
  delay_s: v.number(),
  jitter_s: v.number(),
  loss: v.number(),
  seed: v.number(),
  jitter_distribution: v.picklist(["normal", "heavy_tailed"]),
  duplicate: v.number(),
  reorder: v.number(),
  burst: v.exactOptional(burst),
  outage: v.exactOptional(outage),
}) satisfies v.GenericSchema<unknown, Impairment>;

const network = v.object({ up: impairment, down: impairment });

export const clayShape = v.variant("kind", [
  v.object({ kind: v.literal("block"), size_m: v.exactOptional(vector) }),
  v.object({
    kind: v.literal("stepped"),
    edges_m: v.exactOptional(v.array(v.number())),
    depths_of_cut_m: v.exactOptional(v.array(v.number())),
    base_m: v.exactOptional(v.number()),
    width_m: v.exactOptional(v.number()),
  }),
]) satisfies Check<"ClayShape">;

export const toolShape = v.variant("kind", [
  v.object({ kind: v.literal("ball"), radius_m: v.number() }),
  v.object({ kind: v.literal("blade"), width_m: v.number(), height_m: v.number(), thickness_m: v.number() }),
  v.object({ kind: v.literal("cylinder"), radius_m: v.number(), height_m: v.number() }),
  v.object({ kind: v.literal("loop"), ring_radius_m: v.number(), wire_diameter_m: v.number() }),
]) satisfies Check<"ToolDescription">;

const quantiles = v.object({ p50: v.number(), p99: v.number() });

export const REFUSALS = ["none", "out_of_reach", "too_fast", "wrong_owner", "wrong_epoch", "paused", "fault"] as const satisfies readonly Schemas["SweepRefusal"][];

const toolState = v.object({
  id: v.number(),
  operator: v.string(),
  connected: v.boolean(),
  requests: v.array(v.string()),
  reserved_for: v.nullable(v.string()),
  position_m: vector,
  force_n: vector,
  handle_position_m: vector,
  felt_force_n: vector,
  hand_force_n: vector,
  home_m: vector,
  copy: v.picklist(["none", "live", "stale", "diverged"]),
  hidden_force_n: vector,
  sweeps_refused: v.number(),
  refusal: v.picklist(REFUSALS),
  sweeps_acknowledged: v.number(),
  sweeps_durable: v.number(),
  corrections: v.object({
    count: v.number(),
    moved_n: v.number(),
    held_n: vector,
    largest_step_n: v.number(),
    injected_j: v.number(),
    tank_j: v.number(),
  }),
}) satisfies Check<"ToolState">;

const stop = v.object({ by: v.string(), reason: v.string() }) satisfies Check<"Stop">;

const storage = v.object({
  state: v.picklist(["durable", "behind", "failed", "ephemeral"]),
  durable_revision: v.number(),
  bytes: v.number(),
  reason: v.nullable(v.string()),
}) satisfies Check<"StorageReport">;

const tickQuantiles = v.object({
  p50: v.number(),
  p99: v.number(),
  p999: v.number(),
  max: v.number(),
}) satisfies Check<"TickQuantiles">;

export const sessionSchema: v.GenericSchema<unknown, Session> = v.object({
  id: v.string(),
  revision: v.number(),
  scheme,
  axes: v.picklist([2, 3]),
  state: v.picklist(["idle", "running", "paused", "fault", "stopped"]),
  fault: v.nullable(v.string()),
  stop: v.nullable(stop),
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
  operation,
  deadband: v.number(),
  tools: v.array(toolState),
  position_ratio: v.number(),
  coordination_m: v.number(),
  storage,
  loop: v.object({
    rate_hz: v.number(),
    ticks: v.number(),
    late_ticks: v.number(),
    tick_s: tickQuantiles,
    thread: v.number(),
    own_tick_s: tickQuantiles,
    budget_share: v.number(),
    rtt_s: quantiles,
    age_s: quantiles,
    lost: v.number(),
    duplicates: v.number(),
    reordered: v.number(),
    unheard: v.number(),
    packets_up_per_s: v.number(),
    packets_down_per_s: v.number(),
    energy_j: v.number(),
    scheduler: v.string(),
  }),
});

const damagedSchema = v.object({ id: v.string(), state: v.literal("damaged"), storage }) satisfies v.GenericSchema<unknown, DamagedSession>;

const hasState = v.object({ state: v.string() });

/** Told apart before they are checked, so that a fault is told of the kind that was meant. */
export const sessionEntrySchema: v.GenericSchema<unknown, SessionEntry> = v.lazy((entry) =>
  v.is(hasState, entry) && entry.state === "damaged" ? damagedSchema : sessionSchema);

/** RFC 9457 problem details. */
export const problemSchema: Check<"Problem"> = v.object({
  type: v.string(),
  title: v.string(),
  status: v.number(),
  detail: v.string(),
  pointer: v.exactOptional(v.string()),
});

/** Every field may be left out. */
function partial<E extends v.ObjectEntries>(entries: E): v.ObjectSchema<{ [K in keyof E]: v.ExactOptionalSchema<E[K], undefined> }, undefined> {
  const optional = Object.fromEntries(Object.entries(entries).map(([name, entry]) => [name, v.exactOptional(entry)]));
  return v.object(optional as { [K in keyof E]: v.ExactOptionalSchema<E[K], undefined> });
}

const impairmentPatch = partial({
  ...impairment.entries,
  // `null` ends them.
  burst: v.nullable(partial(burst.entries)),
  outage: v.nullable(partial(outage.entries)),
}) satisfies Check<"ImpairmentPatch">;

/** Changes of a session; what is left out keeps its value. */
export const patchSchema: Check<"SessionPatch"> = partial({
  scheme,
  material: partial(material.entries),
  network: partial({ up: impairmentPatch, down: impairmentPatch }),
  deadband: v.number(),
  operation,
  paused: v.boolean(),
});

/** Asks for a fresh block; what is left out is as it was. */
export const clayResetSchema: Check<"ClayReset"> = partial({ shape: clayShape, material });
