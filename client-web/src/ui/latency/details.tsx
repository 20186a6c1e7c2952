// Everything that one cell holds.

import type { JSX } from "preact";
import type { LatencyCell } from "../../protocol/latency";
import { fixed, significant } from "../format";
import { schemeName } from "../scheme_words";
import { cellName } from "./grid";
import { MEASURES } from "./measures";

export function Details({ cell }: { cell: LatencyCell | undefined }): JSX.Element {
  return (
    <section class="panel details" aria-label="One cell" aria-live="polite" data-testid="details" data-cell={cell === undefined ? undefined : cellName(cell)}>
      <header><h2>{cell === undefined ? "One cell" : `${schemeName(cell.scheme)}, ${1000 * cell.one_way_delay_s} ms one way, ${100 * cell.loss} % loss`}</h2></header>
      {cell === undefined
        ? <p class="faint note">Point at a cell to read all of it; a click keeps it.</p>
        : (
          <dl>
            <div><dt>runs</dt><dd data-grade={cell.stable ? "good" : "bad"}>{cell.stable ? "stable" : stableShare(cell)}<small> {cell.seeds} {cell.seeds === 1 ? "seed" : "seeds"}</small></dd></div>
            {MEASURES.map((measure) => (
              <div key={measure.key} title={measure.says}><dt>{measure.name}</dt><dd>{significant(measure.value(cell))}<small> {measure.unit}</small></dd></div>
            ))}
            <div title="brick by brick, once the line is drained"><dt>clay on both sides</dt><dd>{cell.clay_identical === null ? "–" : cell.clay_identical ? "identical" : "differs"}</dd></div>
          </dl>
        )}
    </section>
  );
}

function stableShare({ stable_share }: LatencyCell): string {
  return stable_share === undefined || stable_share === 0 ? "unstable" : `${fixed(100 * stable_share, 0)} % stable`;
}
