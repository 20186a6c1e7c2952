// What the experiment is set to, and what the theory says to it.

import { computed, signal } from "@preact/signals";
import type { CuttingRequest, HandForceAt } from "../../protocol/theory";

export interface Settings {
  readonly virtual_mass_kg: number;
  readonly virtual_damping_n_s_per_m: number;
  readonly position_ratio: number;
  /** Force ratio `|A_h2|`, hand force per clay force. */
  readonly force_ratio: number;
  readonly hand_force_n: number;
  readonly hand_force_at: HandForceAt;
  /** Handle positions, ascending, one more than there are dampings. */
  readonly edges_m: readonly number[];
  /** Per tool velocity. */
  readonly clay_damping_n_s_per_m: readonly number[];
}

/** Fig. 7: 3–6, 6–9 and 9–12 cm, the clay deeper in each. */
export const PAPER: Settings = {
  virtual_mass_kg: 1,
  virtual_damping_n_s_per_m: 10,
  position_ratio: 1,
  force_ratio: 1,
  hand_force_n: 2,
  hand_force_at: "sensor",
  edges_m: [0.03, 0.06, 0.09, 0.12],
  clay_damping_n_s_per_m: [20, 40, 60],
};

export const MOST_RANGES = 8;

export const settings = signal<Settings>(PAPER);

/** What the figure shows: a run of its own, or the session on show as it runs. */
export type Source = "run" | "live";
export const source = signal<Source>("run");

export function change(changes: Partial<Settings>): void {
  settings.value = { ...settings.value, ...changes };
}

export const request = computed((): CuttingRequest => {
  const { force_ratio, ...rest } = settings.value;
  return { ...rest, force_ratio: -force_ratio, trace_samples: 4000 };
});

/** One range: where it lies, its clay, and the velocity `v_i = f_h / (B + rho B_i)`. */
export interface Range {
  readonly from_m: number;
  readonly to_m: number;
  readonly clay_damping_n_s_per_m: number;
  readonly theory_m_s: number;
}

/** `hand_force_n` is that at the sensor. */
export function rangesOf(of: CuttingRequest): Range[] {
  const rho = of.position_ratio / -of.force_ratio;
  return of.clay_damping_n_s_per_m.map((clay, n) => ({
    from_m: of.edges_m[n],
    to_m: of.edges_m[n + 1],
    clay_damping_n_s_per_m: clay,
    theory_m_s: of.hand_force_n / (of.virtual_damping_n_s_per_m + rho * clay),
  }));
}

/** One more range of the same length, in clay as much stiffer as the last step was. */
export function withRange(of: Settings): Settings {
  const { edges_m: edges, clay_damping_n_s_per_m: clay } = of;
  const length = edges[edges.length - 1] - edges[edges.length - 2];
  const last = clay[clay.length - 1];
  const step = 1 < clay.length ? Math.max(last - clay[clay.length - 2], 0) : last;
  return { ...of, edges_m: [...edges, rounded(edges[edges.length - 1] + length)], clay_damping_n_s_per_m: [...clay, rounded(last + step)] };
}

export function withoutRange(of: Settings): Settings {
  return { ...of, edges_m: of.edges_m.slice(0, -1), clay_damping_n_s_per_m: of.clay_damping_n_s_per_m.slice(0, -1) };
}

/** Sums of decimals as a person would write them. */
const rounded = (value: number): number => Number(value.toPrecision(9));
