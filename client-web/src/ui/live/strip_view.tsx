// One of the plots: its caption, its curves, and the values under the cursor.

import { type Signal, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { StripChart } from "../../plots/strip";
import type { Session, ToolState } from "../../protocol/session";
import { pointsFor, type Term } from "../../state/history";
import { Points } from "../../state/samples";
import { fixed } from "../format";
import { live } from "../store";
import { isDark } from "../theme";
import { followHands } from "./plot_gestures";
import type { PlotSpec } from "./plot_sets";
import { cursorTime_s, plotAxis, plotCursor, plotWindow, shownStretch } from "./plot_view";

/** A plot that is on show. */
export interface Shown {
  readonly spec: PlotSpec;
  readonly chart: StripChart;
  /** Draws what is new, if anything is. */
  readonly draw: () => void;
}

type Values = readonly (number | undefined)[];
const NONE: Values = [];

interface StripProps {
  readonly spec: PlotSpec;
  readonly shown: Set<Shown>;
}

export function StripView({ spec, shown }: StripProps): JSX.Element {
  const host = useRef<HTMLDivElement>(null);
  const chart = useRef<StripChart | undefined>(undefined);
  const values = useSignal<Values>(NONE);

  useEffect(() => {
    const element = host.current;
    if (element === null) return undefined;
    const created = new StripChart(element, { curves: spec.curves, least: spec.least });
    chart.current = created;
    const observer = new ResizeObserver(() => {
      const { clientWidth, clientHeight } = element;
      if (0 < clientWidth && 0 < clientHeight) created.resize(clientWidth, clientHeight);
    });
    observer.observe(element);
    const endHands = followHands(element, () => created);
    const entry = { spec, chart: created, draw: drawing(created, spec, values) };
    shown.add(entry);
    return () => {
      shown.delete(entry);
      endHands();
      observer.disconnect();
      created.dispose();
      chart.current = undefined;
    };
  }, []);
  // The style sheet has followed the theme by the time that effects run; a canvas has to be told.
  useEffect(() => chart.current?.recolour(), [isDark.value]);

  return (
    <figure class="strip" data-testid={`plot-${spec.name}`} title={spec.says}>
      <figcaption>
        <strong>{spec.title}</strong> <span class="faint">{spec.unit}</span>
        <span class="spacer" />
        {spec.curves.map(({ label, colour }, n) => (
          <span key={label} class="legend" style={{ color: `var(${colour})` }}>
            {label}
            {values.value !== NONE && <b>{fixed(values.value[n], spec.places)}</b>}
          </span>
        ))}
      </figcaption>
      <div class="plot" ref={host} />
    </figure>
  );
}

/** The terms of a plot's curves, calculated anew when what they depend on is another. */
export function termsOf(spec: PlotSpec, axis: number, session: Session, tool: ToolState): Term[] {
  return spec.curves.map(({ term }) => term({ axis, session, tool }));
}

/** What draws a plot, and keeps in mind what it drew last. */
function drawing(chart: StripChart, spec: PlotSpec, values: Signal<Values>): () => void {
  const drawn = { from_s: Number.NaN, to_s: Number.NaN, newest_s: Number.NaN, cursor: Number.NaN };
  let terms: readonly Term[] = [];
  let of: { axis: number; session: Session; tool: ToolState } | undefined;
  let columns = 0;
  let points = new Points(0, spec.curves.length);

  return () => {
    const session = live.session.peek();
    const tool = live.tool.peek();
    if (session === undefined || tool === undefined) return;
    const { history } = live;
    const axis = plotAxis.peek();
    const stretch = shownStretch();
    const cursor = plotCursor.peek();
    const isOther = of?.axis !== axis || of.session.position_ratio !== session.position_ratio || of.tool.id !== tool.id || of.tool.home_m !== tool.home_m;
    const isNarrower = columns !== chart.columns;
    const isSame = !isOther && !isNarrower && drawn.from_s === stretch.from_s && drawn.to_s === stretch.to_s
      && Object.is(drawn.cursor, cursor ?? Number.NaN) && (plotWindow.peek().held_s !== undefined || drawn.newest_s === history.newest_s);
    if (isSame) return;
    if (isOther) {
      of = { axis, session, tool };
      terms = termsOf(spec, axis, session, tool);
    }
    if (isNarrower) {
      ({ columns } = chart);
      points = new Points(pointsFor(columns), spec.curves.length);
    }
    drawn.from_s = stretch.from_s;
    drawn.to_s = stretch.to_s;
    drawn.newest_s = history.newest_s;
    drawn.cursor = cursor ?? Number.NaN;

    const isHeld = plotWindow.peek().held_s !== undefined;
    // Near the origin of its numbers, a moment loses nothing: sessions go on for days.
    const origin_s = isHeld ? 0 : stretch.to_s;
    const at_s = cursor === undefined ? undefined : history.sampleNear(stretch.from_s + cursor * (stretch.to_s - stretch.from_s));
    const marks = at_s === undefined ? NONE : terms.map((term) => history.valueNear(term, at_s));
    cursorTime_s.value = at_s;
    values.value = cursor === undefined ? NONE : marks === NONE ? [] : marks;
    history.plot(terms, stretch, columns, origin_s, points);
    chart.point(at_s === undefined ? undefined : at_s - origin_s, marks);
    chart.draw(points, { from_s: stretch.from_s - origin_s, to_s: stretch.to_s - origin_s, clock: isHeld ? "session" : "before now" });
  };
}
