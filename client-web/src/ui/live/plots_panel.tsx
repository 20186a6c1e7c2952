// Force, position and velocity of hand and tool over the last ten seconds, along one axis.

import { useSignal, type Signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { StripChart } from "../../plots/strip";
import { Channel } from "../../protocol/telemetry";
import type { Session, ToolState } from "../../protocol/session";
import { columnsUntil, type Envelope, timesOf } from "../../state/history";
import { fixed } from "../format";
import { onFrame } from "../frame";
import { live } from "../store";
import { isDark } from "../theme";

const SPAN_S = 10;
/** Ten seconds on three hundred pixels move by one in thirty milliseconds: more frames cannot be seen. */
const LEAST_MS = 30;
const AXES = ["x", "y", "z"] as const;

interface CurveSpec {
  readonly label: string;
  readonly colour: string;
  /** Curves that lie on one another are told apart by their width: what is drawn first is wider. */
  readonly width?: number;
  readonly channel: number;
  /** Shown value of a telemetry value, for an axis. */
  readonly shown: (value: number, axis: number, session: Session, tool: ToolState) => number;
}

interface PlotSpec {
  readonly title: string;
  readonly unit: string;
  readonly places: number;
  readonly least: number;
  readonly curves: readonly CurveSpec[];
}

const asItIs = (value: number): number => value;
const inMm = (value: number): number => 1000 * value;
const handleInMm = (value: number, axis: number, session: Session, tool: ToolState): number =>
  1000 * (tool.home_m[axis] + session.position_ratio * value);
const handleSpeedInMm = (value: number, _axis: number, session: Session): number => 1000 * session.position_ratio * value;

const PLOTS: readonly PlotSpec[] = [
  {
    title: "Force", unit: "N", places: 2, least: 0.2,
    curves: [
      { label: "hand", colour: "--hand", width: 3, channel: Channel.hand_force_n, shown: asItIs },
      { label: "felt", colour: "--felt", width: 3, channel: Channel.felt_force_n, shown: asItIs },
      { label: "tool", colour: "--tool", channel: Channel.tool_force_n, shown: asItIs },
    ],
  },
  {
    title: "Position", unit: "mm", places: 1, least: 2,
    curves: [
      { label: "hand", colour: "--hand", width: 3, channel: Channel.handle_position_m, shown: handleInMm },
      { label: "tool", colour: "--tool", channel: Channel.tool_position_m, shown: inMm },
    ],
  },
  {
    title: "Velocity", unit: "mm/s", places: 0, least: 5,
    curves: [
      { label: "hand", colour: "--hand", width: 3, channel: Channel.handle_velocity_m_s, shown: handleSpeedInMm },
      { label: "tool", colour: "--tool", channel: Channel.tool_velocity_m_s, shown: inMm },
    ],
  },
];

export function PlotsPanel(): JSX.Element {
  const axis = useSignal(0);
  /** While the mouse is on a plot, all of them hold still. */
  const held = useSignal(false);
  return (
    <section class="panel plots" aria-label="Plots of the last ten seconds" onPointerLeave={() => { held.value = false; }}>
      <div class="segmented axes" role="radiogroup" aria-label="Axis">
        {AXES.map((name, n) => (
          <label key={name}>
            <input type="radio" name="axis" checked={axis.value === n} onChange={() => { axis.value = n; }} />
            <span>{name}</span>
          </label>
        ))}
      </div>
      {PLOTS.map((spec) => <Strip key={spec.title} spec={spec} axis={axis} held={held} />)}
    </section>
  );
}

interface StripProps {
  readonly spec: PlotSpec;
  readonly axis: Signal<number>;
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
    <figure class="strip" data-testid={`plot-${spec.title.toLowerCase()}`}>
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
function followHistory(chart: StripChart, spec: PlotSpec, axis: Signal<number>, held: Signal<boolean>): () => void {
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
    chart.update(timesOf(columns, now.time_s), spec.curves.map(({ channel, shown }): Envelope =>
      history.envelope(channel + now.axis, columns).map((value) =>
        value === null ? null : shown(value, now.axis, session, tool))));
  });
}
