// The mathematics of the paper as the server offers it: what can be asked, and what it answers. SI units; complex numbers are
// [re, im]; what has no finite value is null.

import * as v from "valibot";

const numbers = v.array(v.number());
const numbersOrNull = v.array(v.nullable(v.number()));
const triple = v.tuple([v.number(), v.number(), v.number()]);
const sign = v.picklist([1, -1]);
const branch = v.tuple([sign, sign, sign]);
const pair = v.tuple([v.number(), v.number()]);

/** Coefficients, highest power first. */
export interface TransferFunction {
  readonly numerator: readonly number[];
  readonly denominator: readonly number[];
}

export interface LoopRequest {
  readonly g_h: TransferFunction;
  readonly t_h: readonly number[];
  readonly c_h1: TransferFunction;
  readonly g_t: TransferFunction;
  readonly position_ratio: number;
  readonly force_ratio: number;
  readonly clay_damping_n_s_per_m: number;
  readonly clay_stiffness_n_per_m: number;
  readonly omegas_rad_s?: readonly number[];
}

const delayVerdict = v.picklist(["unbounded", "finite", "unstable_without_delay", "unstable_admittance"]);
const gainMargin = v.nullable(v.object({ factor: v.number(), omega_rad_s: v.nullable(v.number()) }));

export const loopAnswerSchema = v.object({
  improper_compensators: v.array(v.picklist(["c_h1", "c_t1", "c_h2", "c_t2"])),
  closed_loop_poles: v.array(pair),
  stable_without_delay: v.boolean(),
  delay_margin_force_exchange_s: v.nullable(v.number()),
  delay_verdict_force_exchange: delayVerdict,
  delay_margin_position_force_s: v.nullable(v.number()),
  delay_verdict_position_force: delayVerdict,
  small_gain_holds: v.boolean(),
  small_gain_peak: v.nullable(v.number()),
  nyquist_min_distance: v.nullable(v.number()),
  nyquist_min_omega_rad_s: v.nullable(v.number()),
  gain_margin_increase: gainMargin,
  gain_margin_decrease: gainMargin,
  phase_margin: v.nullable(v.object({ phase_rad: v.number(), omega_rad_s: v.number() })),
  nyquist: v.object({ omega_rad_s: numbers, re: numbers, im: numbers }),
  bode: v.object({ omega_rad_s: numbers, magnitude_db: numbersOrNull, phase_rad: numbersOrNull }),
});

export interface CuttingRequest {
  readonly virtual_mass_kg: number;
  readonly virtual_damping_n_s_per_m: number;
  readonly position_ratio: number;
  readonly force_ratio: number;
  readonly hand_force_n: number;
  readonly edges_m: readonly number[];
  readonly clay_damping_n_s_per_m: readonly number[];
  readonly hand_force_at?: HandForceAt;
  readonly trace_samples?: number;
}
export type HandForceAt = "sensor" | "muscles";

export const cuttingAnswerSchema = v.object({
  plateau_velocity_m_s: numbers,
  simulated_velocity_m_s: numbers,
  ripple: numbers,
  window_m: v.array(pair),
  engaged_area_m2: numbers,
  duration_s: v.number(),
  removed_volume_m3: v.number(),
  specimen: v.object({
    voxel_size_m: v.number(),
    viscosity_pa_s_per_m: v.number(),
    blade_width_m: v.number(),
    depth_of_cut_m: numbers,
  }),
  trace: v.object({
    t_s: numbers,
    position_m: numbers,
    velocity_m_s: numbers,
    hand_force_n: numbers,
    tool_force_n: numbers,
  }),
});

export interface RobotGeometry {
  readonly base_radius_m: number;
  readonly platform_radius_m: number;
  readonly upper_link_m: number;
  readonly lower_link_m: number;
  readonly arm_angles_deg: Triple;
}
export type Triple = readonly [number, number, number];
export type Sign = 1 | -1;
/** `K_j`: which of the two ways each arm bends. */
export type Branch = readonly [Sign, Sign, Sign];

export interface InverseRequest {
  readonly geometry: RobotGeometry;
  readonly position_m: Triple;
}

export const inverseAnswerSchema = v.object({ branches: v.array(v.object({ branch, joints_rad: triple })) });

export interface JacobianRequest extends InverseRequest {
  readonly branch: Branch;
}

export const jacobianAnswerSchema = v.object({
  jacobian: v.tuple([triple, triple, triple]),
  condition_number: v.number(),
  joints_rad: triple,
  elbows_m: v.tuple([triple, triple, triple]),
  serial_measures: triple,
  parallel_measure: v.number(),
});

export interface WorkspaceRequest {
  readonly geometry: RobotGeometry;
  readonly branch: Branch;
  readonly cells: readonly [number, number, number];
}

export const workspaceAnswerSchema = v.object({
  region_m: v.tuple([triple, triple]),
  cells: triple,
  branch,
  dexterity: numbersOrNull,
  reachable_share: v.number(),
  reachable_volume_m3: v.number(),
  mean_dexterity: v.nullable(v.number()),
});

export type DelayVerdict = v.InferOutput<typeof delayVerdict>;
export type LoopAnswer = v.InferOutput<typeof loopAnswerSchema>;
export type CuttingAnswer = v.InferOutput<typeof cuttingAnswerSchema>;
export type InverseAnswer = v.InferOutput<typeof inverseAnswerSchema>;
export type JacobianAnswer = v.InferOutput<typeof jacobianAnswerSchema>;
export type WorkspaceAnswer = v.InferOutput<typeof workspaceAnswerSchema>;
