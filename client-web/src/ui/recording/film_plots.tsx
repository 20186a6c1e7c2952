// Force, motion, energy and link over a whole recording, or over a stretch about the moment on show.

import { useComputed, useSignal, useSignalEffect, type Signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { StripChart } from "../../plots/strip";
import type { FilmSettings } from "../../protocol/film";
import type { Film } from "../../state/film";
import type { Term } from "../../state/history";
import { Choice } from "../choice";
import { fixed } from "../format";
import { AXES, PLOT_SETS, type PlotSet, type PlotSpec } from "../live/plot_sets";
import { isDark } from "../theme";
import { pointsOf, stretchAbout } from "./curve";

const SETS = [
  { value: "motion", text: "motion", title: "force, position and velocity of hand and tool" },
  { value: "link", text: "link", title: "energy at both ports, what the hand felt against what the clay did, round trip" },
  { value: "copy", text: "copy", title: "what a copy of the clay hid, how it was corrected, how old the server's news of the hand were" },
] as const;
const ZOOM = 2;
/** Fewer columns than this are no curve. */
const LEAST_COLUMNS = 16;
/** Before a recording is set to anything. */
const PLAIN = { position_ratio: 1, home_m: [0, 0, 0] } satisfies Pick<FilmSettings, "position_ratio" | "home_m">;

export function FilmPlots({ film, tool }: { readonly film: Film; readonly tool: number }): JSX.Element {
  const set = useSignal<PlotSet>("motion");
  const axis = useSignal(0);
  /** What the plots show about the moment, s; without end: all. */
  const span_s = useSignal(Number.POSITIVE_INFINITY);
  const column_s = useComputed(() => film.facts.value?.column_s ?? 0).value;
  const zoom = (factor: number): void => {
    const wanted_s = Math.min(span_s.peek(), film.lasts_s) * factor;
    span_s.value = film.lasts_s <= wanted_s ? Number.POSITIVE_INFINITY : Math.max(wanted_s, LEAST_COLUMNS * column_s);
  };
  return (
    <section class="panel plots" aria-label="Plots" data-testid="reel-plots">
      <div class="axes">
        <Choice name="reel-plots" label="Plots" options={SETS} value={set.value} onChoose={(value) => { set.value = value; }} />
        <div class="tools" role="group" aria-label="Time on show">
          <button type="button" class="mini" onClick={() => zoom(1 / ZOOM)} aria-label="Zoom in" title="a shorter stretch about the moment" data-testid="reel-in">+</button>
          <button type="button" class="mini" onClick={() => zoom(ZOOM)} aria-label="Zoom out" title="a longer stretch" data-testid="reel-out">−</button>
          <button type="button" class="mini" onClick={() => { span_s.value = Number.POSITIVE_INFINITY; }} title="the whole recording">All</button>
        </div>
        <Choice
          name="reel-axis"
          label="Axis"
          options={AXES.map((value) => ({ value, text: value }))}
          value={AXES[axis.value]}
          onChoose={(name) => { axis.value = AXES.indexOf(name); }}
        />
      </div>
      <div class="strips">
        {PLOT_SETS[set.value].map((spec) => <FilmStrip key={spec.name} film={film} tool={tool} spec={spec} axis={axis.value} span={span_s} />)}
      </div>
    </section>
  );
}

interface StripProps {
  readonly film: Film;
  readonly tool: number;
  readonly spec: PlotSpec;
  readonly axis: number;
  readonly span: Signal<number>;
}

function FilmStrip({ film, tool, spec, axis, span }: StripProps): JSX.Element {
  const host = useRef<HTMLDivElement>(null);
  const chart = useSignal<StripChart | undefined>(undefined);
  const columns = useSignal(300);
  const settings = useComputed(() => JSON.stringify(placing(film.moment.value?.settings))).value;
  const terms = useComputed((): Term[] => spec.curves.map(({ term }) => term({ axis, session: placing(film.moment.value?.settings), tool: placing(film.moment.value?.settings) })));

  useEffect(() => {
    const element = host.current;
    if (element === null) return undefined;
    const created = new StripChart(element, { curves: spec.curves, least: spec.least });
    const observer = new ResizeObserver(() => {
      const { clientWidth, clientHeight } = element;
      if (clientWidth === 0 || clientHeight === 0) return;
      created.resize(clientWidth, clientHeight);
      columns.value = created.columns;
    });
    observer.observe(element);
    chart.value = created;
    return () => {
      chart.value = undefined;
      observer.disconnect();
      created.dispose();
    };
  }, []);
  useEffect(() => chart.peek()?.recolour(), [isDark.value]);

  // Asked for anew whenever something else would come.
  useSignalEffect(() => {
    const facts = film.facts.value;
    if (facts === undefined || facts.lasts_s === 0) return;
    const at_s = span.value < facts.lasts_s ? film.wished_s.value : 0;
    const stretch = stretchAbout(at_s, span.value, facts.lasts_s);
    const most = Math.max(Math.floor((stretch.to_s - stretch.from_s) / facts.column_s), 1);
    film.plot(spec.name, { tool, channels: terms.value.map(({ channel }) => channel), ...stretch, columns: Math.min(columns.value, most) });
  });
  useEffect(() => {
    const facts = film.facts.peek();
    if (facts === undefined || facts.lasts_s === 0) return;
    const stretch = stretchAbout(film.wished_s.peek(), span.peek(), facts.lasts_s);
    film.plot(spec.name, { tool, channels: terms.peek().map(({ channel }) => channel), ...stretch, columns: columns.peek() });
  }, [axis, tool, settings]);

  useSignalEffect(() => {
    const drawn = film.plots.value.get(spec.name);
    if (chart.value === undefined || drawn?.envelopes.length !== terms.value.length) return;
    const at_s = film.moment.value?.at_s;
    chart.value.point(at_s, valuesOf(film, tool, terms.value));
    chart.value.draw(pointsOf(terms.value, drawn.plot, drawn.envelopes), { ...drawn.plot, clock: "session" });
  });

  const values = valuesOf(film, tool, terms.value);
  const point = (event: PointerEvent): void => {
    const plot = film.plots.peek().get(spec.name)?.plot;
    const box = host.current?.getBoundingClientRect();
    const drawn = chart.peek();
    if (plot === undefined || box === undefined || drawn === undefined) return;
    const share = (event.clientX - box.left - drawn.left_px) / drawn.width_px;
    film.seek(plot.from_s + Math.min(Math.max(share, 0), 1) * (plot.to_s - plot.from_s));
  };
  return (
    <figure class="strip" data-testid={`plot-${spec.name}`} title={spec.says}>
      <figcaption>
        <strong>{spec.title}</strong> <span class="faint">{spec.unit}</span>
        <span class="spacer" />
        {spec.curves.map(({ label, colour }, n) => (
          <span key={label} class="legend" style={{ color: `var(${colour})` }}>
            {label}
            <b data-testid={`value-${spec.name}-${n}`}>{fixed(values[n], spec.places)}</b>
          </span>
        ))}
      </figcaption>
      <div
        class="plot"
        ref={host}
        onPointerDown={(event) => {
          if (event.button !== 0) return;
          event.currentTarget.setPointerCapture(event.pointerId);
          point(event);
        }}
        onPointerMove={(event) => {
          if (event.currentTarget.hasPointerCapture(event.pointerId)) point(event);
        }}
      />
    </figure>
  );
}

function placing(settings: FilmSettings | null | undefined): Pick<FilmSettings, "position_ratio" | "home_m"> {
  if (settings === null || settings === undefined) return PLAIN;
  return { position_ratio: settings.position_ratio, home_m: settings.home_m };
}

/** What the curves have at the moment on show. */
function valuesOf(film: Film, number: number, terms: readonly Term[]): (number | undefined)[] {
  const tool = film.moment.value?.tools.find((one) => one.tool === number);
  return terms.map(({ channel, factor, offset }) => {
    const value = tool?.values[channel];
    return typeof value === "number" ? offset + factor * value : undefined;
  });
}

