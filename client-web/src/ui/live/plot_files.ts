// What the plots show, as files: a picture, and a table of every sample.

import { pictureOf } from "../../plots/picture";
import { sessionTime } from "../../plots/time_axis";
import { tableOf } from "../../state/plot_table";
import { downloadFile } from "../download";
import { live } from "../store";
import { AXES, columnOf, PLOT_SETS } from "./plot_sets";
import { plotAxis, plotSet, shownStretch } from "./plot_view";
import { type Shown, termsOf } from "./strip_view";

export async function savePicture(shown: Iterable<Shown>, panel: Element): Promise<void> {
  const order = PLOT_SETS[plotSet.peek()];
  const inOrder = [...shown].sort((a, b) => order.indexOf(a.spec) - order.indexOf(b.spec));
  const strips = inOrder.map(({ spec, chart }) => ({ title: spec.title, unit: spec.unit, curves: spec.curves, canvas: chart.canvas }));
  const picture = await pictureOf(strips, titleOf(), panel);
  if (picture !== undefined) downloadFile(`${nameOf()}.png`, picture);
}

/** The curves on show, a column each; one that is in two plots of a set once. */
export function saveTable(): void {
  const session = live.session.peek();
  const tool = live.tool.peek();
  if (session === undefined || tool === undefined) return;
  const axis = plotAxis.peek();
  const columns = new Map(PLOT_SETS[plotSet.peek()].flatMap((spec) => {
    const terms = termsOf(spec, axis, session, tool);
    return spec.curves.map((curve, n) => [columnOf(spec, curve, axis), terms[n]] as const);
  }));
  const table = tableOf(live.history, [...columns].map(([name, term]) => ({ name, term })), shownStretch());
  downloadFile(`${nameOf()}.csv`, new Blob(table, { type: "text/csv" }));
}

/** As `demo-motion-x-83.2s`: session, what is shown, and the moment at the right edge. */
function nameOf(): string {
  const { to_s } = shownStretch();
  return [live.session.peek()?.id, plotSet.peek(), AXES[plotAxis.peek()], `${to_s.toFixed(1)}s`].filter((part) => part !== undefined).join("-");
}

function titleOf(): string {
  const { from_s, to_s } = shownStretch();
  const parts = [`session ${live.session.peek()?.id ?? ""}`, `axis ${AXES[plotAxis.peek()]}`, `${sessionTime(Math.max(from_s, 0), 2)} to ${sessionTime(to_s, 2)}`];
  return parts.join("  ·  ");
}
