// The experiment's table, and its files.

import type { CuttingAnswer, CuttingRequest } from "../../protocol/theory";
import { rangesOf } from "./model";

export interface PlateauRow {
  readonly from_m: number;
  readonly to_m: number;
  readonly clay_damping_n_s_per_m: number;
  readonly theory_m_s: number;
  readonly measured_m_s: number;
  /** Measured over theory, less one. */
  readonly deviation: number;
  /** Greatest less least velocity over the mean. */
  readonly ripple: number;
  readonly engaged_area_m2: number;
}

export function plateaus(asked: CuttingRequest, answer: CuttingAnswer): PlateauRow[] {
  return rangesOf(asked).map((range, n) => ({
    ...range,
    theory_m_s: answer.plateau_velocity_m_s[n],
    measured_m_s: answer.simulated_velocity_m_s[n],
    deviation: answer.simulated_velocity_m_s[n] / answer.plateau_velocity_m_s[n] - 1,
    ripple: answer.ripple[n],
    engaged_area_m2: answer.engaged_area_m2[n],
  }));
}

export function plateausCsv(rows: readonly PlateauRow[]): string {
  return csv(
    ["from_m", "to_m", "clay_damping_n_s_per_m", "theory_velocity_m_s", "measured_velocity_m_s", "deviation", "ripple", "engaged_area_m2"],
    rows.map((row) => [
      row.from_m, row.to_m, row.clay_damping_n_s_per_m, row.theory_m_s, row.measured_m_s, row.deviation, row.ripple, row.engaged_area_m2,
    ]),
  );
}

export function traceCsv({ t_s, position_m, velocity_m_s, hand_force_n, tool_force_n }: CuttingAnswer["trace"]): string {
  return csv(
    ["t_s", "position_m", "velocity_m_s", "hand_force_n", "tool_force_n"],
    t_s.map((t, n) => [t, position_m[n], velocity_m_s[n], hand_force_n[n], tool_force_n[n]]),
  );
}

/** RFC 4180: numbers as programs read them, lines that end in CR LF. */
function csv(head: readonly string[], rows: readonly (readonly number[])[]): string {
  return [head.join(","), ...rows.map((row) => row.join(","))].map((line) => `${line}\r\n`).join("");
}
