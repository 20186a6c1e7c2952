// What hand, tool and link did over the last ten seconds.

import { useSignal, type ReadonlySignal, type Signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { StripChart } from "../../plots/strip";
import { columnsUntil, type Envelope, timesOf } from "../../state/history";
import { Choice } from "../choice";
import { fixed } from "../format";
import { onFrame } from "../frame";
import { live } from "../store";
import { isDark } from "../theme";
import { PLOT_SETS, type PlotSet, type PlotSpec } from "./plot_sets";

const SPAN_S = 10;
/** Ten seconds on three hundred pixels move by one in thirty milliseconds: more frames cannot be seen. */
const LEAST_MS = 30;
const AXES = ["x", "y", "z"] as const;

/** Which set of plots is on show; it outlives the panel. */
const SETS = [
  { value: "motion", text: "motion", title: "force, position and velocity of hand and tool" },
  { value: "link", text: "link", title: "energy at both ports, what the hand feels against what the clay does, round trip" },
  { value: "copy", text: "copy", title: "what a copy of the clay hides, how it is corrected, how old the server's news of the hand are" },
] as const;

export function PlotsPanel(): JSX.Element {
  const set = useSignal<PlotSet>("motion");
  const axis = useSignal(0);
  /** While the mouse is on a plot, all of them hold still. */
  const held = useSignal(false);
  return (
    <section class="panel plots" aria-label="Plots of the last ten seconds" onPointerLeave={() => { held.value = false; }}>
      <div class="axes">
        <Choice name="plots" label="Plots" options={SETS} value={set.value} onChoose={(value) => { set.value = value; }} />
        <Choice
          name="axis"
          label="Axis"
          options={AXES.map((value) => ({ value, text: value }))}
          value={AXES[axis.value]}
          onChoose={(name) => { axis.value = AXES.indexOf(name); }}
        />
      </div>
      {PLOT_SETS[set.value].map((spec) => <Strip key={spec.name} spec={spec} axis={axis} held={held} />)}
    </section>
  );
}

interface StripProps {
  readonly spec: PlotSpec;
  readonly axis: ReadonlySignal<number>;
  readonly held: Signal<boolean>;
}

function Strip({ spec, axis, held }: StripProps): JSX.Element {
  const host = useRef<HTMLDivElement>(null);
  const chart = useRef<StripChart | undefined>(undefined);
  const point = useSignal<{ values: readonly (number | null)[]; time_s: number } | undefined>(undefined);

  useEffect(() => {
    const element = host.current;
    if (element === null) return undefined;
    const created = new StripChart(element, {
      curves: spec.curves,
      span_s: SPAN_S,
      least: spec.least,
      onPoint: (values, time_s) => {
        point.value = values === undefined ? undefined : { values, time_s };
      },
    });
    chart.current = created;
    const observer = new ResizeObserver(() => {
      const { clientWidth, clientHeight } = element;
      if (0 < clientWidth && 0 < clientHeight) created.resize(clientWidth, clientHeight);
    });
    observer.observe(element);
    const endFrames = followHistory(created, spec, axis, held);
    return () => {
      endFrames();
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
            {point.value !== undefined && <b>{fixed(point.value.values[n] ?? undefined, spec.places)}</b>}
          </span>
        ))}
        {point.value !== undefined && <span class="faint">at {fixed(point.value.time_s, 2)} s</span>}
      </figcaption>
      <div class="plot" ref={host} onPointerEnter={() => { held.value = true; }} />
    </figure>
  );
}

/** Draws as time goes on, as often as can be seen, and not while the plots are held. */
function followHistory(chart: StripChart, spec: PlotSpec, axis: ReadonlySignal<number>, held: Signal<boolean>): () => void {
  let drawn = { time_s: Number.NaN, axis: -1 };
  let last_ms = Number.NEGATIVE_INFINITY;
  return onFrame((now_ms) => {
    const time_s = live.momentAt(now_ms);
    if (now_ms - last_ms < LEAST_MS) return;
    const { history } = live;
    const session = live.session.peek();
    const tool = live.tool.peek();
    const now = { time_s, axis: axis.peek() };
    const same = now.time_s === drawn.time_s && now.axis === drawn.axis;
    if (session === undefined || tool === undefined || same || (held.peek() && now.axis === drawn.axis)) return;
    drawn = now;
    last_ms = now_ms;
    const columns = columnsUntil(now.time_s, SPAN_S, chart.columns);
    chart.update(timesOf(columns, now.time_s), spec.curves.map(({ terms, offset }): Envelope => {
      const moment = { axis: now.axis, session, tool };
      const level = offset?.(moment) ?? 0;
      return history.envelope(terms(moment), columns).map((value) => (value === null ? null : level + value));
    }));
  });
}
