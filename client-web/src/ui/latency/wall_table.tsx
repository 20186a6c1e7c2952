// The oracle: where a naive wall turns unstable in theory, and where it did on the rig.

import type { JSX } from "preact";
import type { WallRow } from "../../protocol/latency";
import { fixed, significant } from "../format";

/** A simulator that misses the theory by more is wrong. */
const TOLERANCE = 0.01;

export function WallTable({ rows }: { rows: readonly WallRow[] }): JSX.Element | null {
  if (rows.length === 0) return null;
  return (
    <section class="panel wall" aria-label="The naive wall" data-testid="wall">
      <header><h2>The naive wall</h2><span class="faint">stiffness at which it turns unstable: if the rig misses the theory, no cell above counts</span></header>
      <table class="data">
        <thead><tr><th scope="col">round trip, ms</th><th scope="col">mass, kg</th><th scope="col">damping, N·s/m</th><th scope="col">theory, N/m</th><th scope="col">rig, N/m</th><th scope="col">apart, %</th></tr></thead>
        <tbody>
          {rows.map((row) => {
            const apart = row.measured_stiffness_n_per_m === null ? undefined : row.measured_stiffness_n_per_m / row.critical_stiffness_n_per_m - 1;
            return (
              <tr key={`${row.rtt_s} ${row.mass_kg} ${row.damping_n_s_per_m}`}>
                <th scope="row">{significant(1000 * row.rtt_s)}</th>
                <td>{significant(row.mass_kg)}</td>
                <td>{significant(row.damping_n_s_per_m)}</td>
                <td>{significant(row.critical_stiffness_n_per_m, 4)}</td>
                <td>{significant(row.measured_stiffness_n_per_m ?? undefined, 4)}</td>
                <td data-grade={apart !== undefined && Math.abs(apart) <= TOLERANCE ? "good" : "bad"}>{fixed(apart === undefined ? undefined : 100 * apart, 2)}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </section>
  );
}
