// Fig. 7 from the running session: what the last passage through each range came to, and what the theory says to the
// hand's own force there. SI units; positions are the handle's, counted from where the block begins.

import type { Session, ToolState } from "../../protocol/session";

/** Samples of the running session, oldest first. */
export interface LivePath {
  readonly position_m: readonly number[];
  readonly velocity_m_s: readonly number[];
  /** Of the hand on the handle, along x. */
  readonly hand_force_n: readonly number[];
  /** Height of the tool in the clay's frame. */
  readonly height_m: readonly number[];
}

/** The handle's own law, which the session does not tell: as on this page. */
export interface HandleLaw {
  readonly virtual_damping_n_s_per_m: number;
  readonly position_ratio: number;
  /** Force ratio `|A_h2|`, hand force per clay force. */
  readonly force_ratio: number;
}

/** A step of the session's block, as far as a blade meets it. */
export interface SessionRange {
  readonly from_m: number;
  readonly to_m: number;
  /** The step's top, in the clay's frame. */
  readonly top_m: number;
  readonly blade_width_m: number;
  readonly viscosity_pa_s_per_m: number;
  readonly yield_stress_pa: number;
}

export interface Passage extends SessionRange {
  /** Means over the last third of the newest passage; nothing before the first. */
  readonly measured_m_s: number | undefined;
  readonly hand_force_n: number | undefined;
  readonly engaged_area_m2: number | undefined;
  readonly theory_m_s: number | undefined;
}

/** Fewer samples than this make no mean. */
const LEAST_SAMPLES = 8;
/**
 * Of a range's length: the hand has settled by the time it comes to its last third, and the next step is not felt yet.
 */
const WINDOW = { from: 0.66, to: 0.97 };

/** The ranges of a session that cuts the stepped block with a blade; none for any other. */
export function rangesOfSession({ clay: { shape }, tool, material, position_ratio }: Session): SessionRange[] {
  if (shape.kind !== "stepped" || tool.kind !== "blade") return [];
  const { edges_m = [], depths_of_cut_m = [], base_m = 0 } = shape;
  return depths_of_cut_m.map((depth, n) => ({
    from_m: edges_m[n] / position_ratio,
    to_m: edges_m[n + 1] / position_ratio,
    top_m: base_m + depth,
    blade_width_m: tool.width_m,
    viscosity_pa_s_per_m: material.viscosity_pa_s_per_m,
    yield_stress_pa: material.yield_stress_pa,
  }));
}

/** Where the handle is when the tool is where the block begins. */
export function startOf(session: Session, tool: ToolState): number {
  return -tool.home_m[0] / session.position_ratio;
}

export function passageOf(range: SessionRange, path: LivePath, law: HandleLaw): Passage {
  const samples = newestPassage(path, range);
  if (samples.length < LEAST_SAMPLES) {
    return { ...range, measured_m_s: undefined, hand_force_n: undefined, engaged_area_m2: undefined, theory_m_s: undefined };
  }
  const mean = (values: readonly number[]): number => samples.reduce((sum, n) => sum + values[n], 0) / samples.length;
  const engaged_area_m2 = range.blade_width_m * Math.max(range.top_m - mean(path.height_m), 0);
  const hand_force_n = mean(path.hand_force_n);
  return {
    ...range, engaged_area_m2, hand_force_n,
    measured_m_s: mean(path.velocity_m_s),
    theory_m_s: theoryAt(hand_force_n, engaged_area_m2, range, law),
  };
}

/** `v = (f_h - sigma_y A / |A_h2|) / (B + rho k A)`: the paper's for clay that only flows. */
export function theoryAt(
  hand_force_n: number,
  area_m2: number,
  { viscosity_pa_s_per_m, yield_stress_pa }: Pick<SessionRange, "viscosity_pa_s_per_m" | "yield_stress_pa">,
  { virtual_damping_n_s_per_m, position_ratio, force_ratio }: HandleLaw,
): number {
  const push_n = hand_force_n - (yield_stress_pa * area_m2) / force_ratio;
  return Math.max(push_n, 0) / (virtual_damping_n_s_per_m + (position_ratio / force_ratio) * viscosity_pa_s_per_m * area_m2);
}

/**
 * Indices of the samples of the newest forward passage through a range's window that is long enough for a mean; or
 * none.
 */
function newestPassage({ position_m, velocity_m_s }: LivePath, { from_m, to_m }: SessionRange): number[] {
  const length_m = to_m - from_m;
  const isWithin = (n: number): boolean =>
    from_m + WINDOW.from * length_m <= position_m[n] && position_m[n] <= from_m + WINDOW.to * length_m && 0 < velocity_m_s[n];
  let samples: number[] = [];
  for (let n = position_m.length - 1; 0 <= n; n -= 1) {
    if (isWithin(n)) samples.push(n);
    else if (LEAST_SAMPLES <= samples.length) break;
    else samples = [];
  }
  return samples.reverse();
}
