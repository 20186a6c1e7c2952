// The mathematics of the paper as the server offers it: what can be asked, and what it answers. SI units; complex
// numbers are [re, im]; what has no finite value is null.

import * as v from "valibot";
import type { Check, Schemas } from "./api";

export type TransferFunction = Schemas["TransferFunction"];
export type LoopRequest = Schemas["LoopRequest"];
export type LoopAnswer = Schemas["LoopAnswer"];
export type DelayVerdict = Schemas["DelayVerdict"];
export type CuttingRequest = Schemas["CuttingRequest"];
export type CuttingAnswer = Schemas["CuttingAnswer"];
export type HandForceAt = Schemas["HandForceAt"];
/** As an answer has it, and as this page asks: with every dimension. */
export type RobotGeometry = Schemas["RobotGeometry"];
export type InverseRequest = Required<Schemas["InverseRequest"]>;
export type InverseAnswer = Schemas["InverseAnswer"];
export type JacobianRequest = Required<Schemas["JacobianRequest"]>;
export type JacobianAnswer = Schemas["JacobianAnswer"];
export type WorkspaceRequest = Schemas["WorkspaceRequest"];
export type WorkspaceAnswer = Schemas["WorkspaceAnswer"];
export type Triple = Schemas["Vector"];
/** `K_j`: which of the two ways each arm bends. */
export type Branch = Schemas["Branch"];
export type Sign = Branch[number];

const numbers = v.array(v.number());
const numbersOrNull = v.array(v.nullable(v.number()));
const triple = v.tuple([v.number(), v.number(), v.number()]) satisfies Check<"Vector">;
const sign = v.picklist([1, -1]);
const branch = v.tuple([sign, sign, sign]) satisfies Check<"Branch">;
const pair = v.tuple([v.number(), v.number()]) satisfies Check<"Pair">;

const delayVerdict = v.picklist(["unbounded", "finite", "unstable_without_delay", "unstable_admittance"]) satisfies Check<"DelayVerdict">;
const gainMargin = v.nullable(v.object({ factor: v.number(), omega_rad_s: v.nullable(v.number()) }));
const compensator = v.nullable(pair);

export const loopAnswerSchema: Check<"LoopAnswer"> = v.object({
  compensators: v.array(v.object({ omega_rad_s: v.number(), c_h1: compensator, c_t1: compensator, c_h2: compensator, c_t2: compensator })),
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

export const cuttingAnswerSchema: Check<"CuttingAnswer"> = v.object({
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

const one = v.object({ branch, joints_rad: triple });
export const inverseAnswerSchema: Check<"InverseAnswer"> = v.object({ branches: v.tuple([one, one, one, one, one, one, one, one]) });

export const jacobianAnswerSchema: Check<"JacobianAnswer"> = v.object({
  jacobian: v.tuple([triple, triple, triple]),
  condition_number: v.number(),
  joints_rad: triple,
  elbows_m: v.tuple([triple, triple, triple]),
  serial_measures: triple,
  parallel_measure: v.number(),
});

export const workspaceAnswerSchema: Check<"WorkspaceAnswer"> = v.object({
  region_m: v.tuple([triple, triple]),
  cells: triple,
  branch,
  dexterity: numbersOrNull,
  reachable_share: v.number(),
  reachable_volume_m3: v.number(),
  mean_dexterity: v.nullable(v.number()),
});
