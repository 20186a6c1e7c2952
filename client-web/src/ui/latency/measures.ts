// What a cell of the table can be looked at for, and how good a value of it is.

import type { LatencyCell } from "../../protocol/latency";
import { fixed, significant } from "../format";

export interface Measure {
  readonly key: string;
  readonly name: string;
  readonly unit: string;
  readonly says: string;
  /** In the unit; nothing where it was not measured. */
  readonly value: (cell: LatencyCell) => number | undefined;
  /** In the unit: at `good` and below a cell is as good as can be, at `bad` and above as bad. */
  readonly good: number;
  readonly bad: number;
}

const orNothing = (value: number | null | undefined, factor: number): number | undefined =>
  value === null || value === undefined ? undefined : value * factor;

export const MEASURES: readonly Measure[] = [
  {
    key: "force_nrmse", name: "force error", unit: "%", good: 1, bad: 100,
    says: "felt force against the run without delay of the same seed, root mean square over the range",
    value: (cell) => orNothing(cell.force_nrmse, 100),
  },
  {
    key: "share_force_error_above_jnd", name: "time with a force error above 7 %", unit: "%", good: 1, bad: 60,
    says: "7 % is the least difference that a hand notices",
    value: (cell) => orNothing(cell.share_force_error_above_jnd, 100),
  },
  {
    key: "removed_volume_error", name: "removed volume error", unit: "%", good: 0.1, bad: 20,
    says: "clay removed against the run without delay, either way",
    value: (cell) => (cell.removed_volume_error === null ? undefined : 100 * Math.abs(cell.removed_volume_error)),
  },
  {
    key: "position_rmse_m", name: "position error", unit: "mm", good: 0.1, bad: 20,
    says: "tool against the run without delay, root mean square",
    value: (cell) => orNothing(cell.position_rmse_m, 1000),
  },
  {
    key: "coordination_rmse_m", name: "hand and tool apart", unit: "mm", good: 0.1, bad: 50,
    says: "distance between the tool and where the hand would have it, root mean square",
    value: (cell) => orNothing(cell.coordination_rmse_m, 1000),
  },
  {
    key: "min_energy_j", name: "energy made by the link", unit: "mJ", good: 1e-3, bad: 100,
    says: "how far below zero the passivity observer fell; a passive link makes none",
    value: (cell) => (cell.min_energy_j === null ? undefined : 1000 * Math.max(-cell.min_energy_j, 0)),
  },
  {
    key: "correction_step_n", name: "force step of corrections, p99", unit: "N", good: 0.01, bad: 2,
    says: "how much the authority's corrections jump in the hand within a tick",
    value: (cell) => orNothing(cell.correction_step_n?.p99, 1),
  },
  {
    key: "hidden_force_nrmse", name: "force that the copy hides", unit: "%", good: 1, bad: 100,
    says: "felt force against the authority's at the same time, root mean square over the range; only schemes with a copy hide any",
    value: (cell) => orNothing(cell.hidden_force_nrmse, 100),
  },
  {
    key: "packets_per_s", name: "packets", unit: "/s", good: 100, bad: 4000,
    says: "both ways",
    value: (cell) => orNothing(cell.packets_per_s, 1),
  },
  {
    key: "bytes_per_s", name: "data", unit: "kB/s", good: 5, bad: 500,
    says: "both ways",
    value: (cell) => orNothing(cell.bytes_per_s, 1e-3),
  },
];

/** 0 … 1, from good to bad by decades; nothing where there is no value. A run that came apart is as bad as can be. */
export function badness(measure: Measure, cell: LatencyCell): number | undefined {
  if (!cell.stable) return 1;
  const value = measure.value(cell);
  if (value === undefined) return undefined;
  const share = Math.log(Math.max(value, 1e-30) / measure.good) / Math.log(measure.bad / measure.good);
  return Math.min(Math.max(share, 0), 1);
}

/** As short as fits a cell. */
export function shortText(value: number | undefined): string {
  if (value === undefined) return "–";
  if (value === 0) return "0";
  if (value < 0.01) return value.toExponential(0).replace("e-", "e−");
  return 100 <= value ? (value < 10_000 ? fixed(value, 0) : value.toExponential(0).replace("e+", "e")) : significant(value, 2);
}
