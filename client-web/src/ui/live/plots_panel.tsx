// What hand, tool and link did over the last minutes: as it goes on, or held, at any scale.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { sessionTime } from "../../plots/time_axis";
import { stretchOf } from "../../state/plot_window";
import { Choice } from "../choice";
import { onFrame } from "../frame";
import { live } from "../store";
import type * as plotFiles from "./plot_files";
import { KEYS, takeKey } from "./plot_gestures";
import { AXES, PLOT_SETS } from "./plot_sets";
import { cursorTime_s, passTo, plotAxis, plotCursor, plotSet, plotWindow, view } from "./plot_view";
import { type Shown, StripView } from "./strip_view";

/** Ten seconds on three hundred pixels move by one in thirty milliseconds: more frames cannot be seen. */
const LEAST_MS = 30;
const ZOOM = 1.6;
const SPANS = [
  { span_s: 1, text: "1 s" }, { span_s: 10, text: "10 s" }, { span_s: 60, text: "1 min" }, { span_s: 300, text: "5 min" },
];

const SETS = [
  { value: "motion", text: "motion", title: "force, position and velocity of hand and tool" },
  { value: "link", text: "link", title: "energy at both ports, what the hand feels against what the clay does, round trip" },
  { value: "copy", text: "copy", title: "what a copy of the clay hides, how it is corrected, how old the server's news of the hand are" },
] as const;

export function PlotsPanel(): JSX.Element {
  const panel = useRef<HTMLElement>(null);
  const shown = useRef(new Set<Shown>());
  /** Spoken where a key has moved the cursor, or held the plots. */
  const spoken = useSignal("");
  useEffect(() => followTime(shown.current), []);
  const onKeyDown = (event: KeyboardEvent): void => {
    if (!takeKey(event)) return;
    event.preventDefault();
    for (const { draw } of shown.current) draw();
    requestAnimationFrame(() => { spoken.value = readingOf(panel.current); });
  };
  return (
    <section class="panel plots" aria-label="Plots" ref={panel} data-held={plotWindow.value.held_s !== undefined}>
      <div class="axes">
        <Choice name="plots" label="Plots" options={SETS} value={plotSet.value} onChoose={(value) => { plotSet.value = value; }} />
        <Tools shown={shown.current} panel={() => panel.current} />
        <Choice
          name="axis"
          label="Axis"
          options={AXES.map((value) => ({ value, text: value }))}
          value={AXES[plotAxis.value]}
          onChoose={(name) => { plotAxis.value = AXES.indexOf(name); }}
        />
      </div>
      <div class="strips" role="application" aria-label="Plots over time" aria-describedby="plot-keys" tabIndex={0} onKeyDown={onKeyDown} data-testid="strips">
        {PLOT_SETS[plotSet.value].map((spec) => <StripView key={spec.name} spec={spec} shown={shown.current} />)}
      </div>
      <p class="hidden" id="plot-keys">Keys: {KEYS}.</p>
      <p class="hidden" aria-live="polite" data-testid="plot-reading">{spoken.value}</p>
    </section>
  );
}

/** Pause, zoom, span, files. */
function Tools({ shown, panel }: { shown: ReadonlySet<Shown>; panel: () => Element | null }): JSX.Element {
  const { span_s, held_s } = plotWindow.value;
  const isListed = SPANS.some((span) => span.span_s === span_s);
  const isHeld = held_s !== undefined;
  return (
    <div class="tools" role="group" aria-label="Time on show">
      <Clock />
      <button type="button" class="mini" aria-pressed={isHeld} onClick={isHeld ? view.goOn : view.pause} data-testid="plots-hold" title={isHeld ? "follow what happens again (space)" : "hold the plots still; the session goes on (space)"}>
        <i class={isHeld ? "sign go" : "sign hold"} aria-hidden="true" /> {isHeld ? "Go on" : "Hold"}
      </button>
      <button type="button" class="mini" onClick={() => view.zoom(1 / ZOOM)} aria-label="Zoom in" title="zoom in (wheel, +)" data-testid="plots-in">+</button>
      <button type="button" class="mini" onClick={() => view.zoom(ZOOM)} aria-label="Zoom out" title="zoom out (wheel, −)" data-testid="plots-out">−</button>
      <select aria-label="Span of time" value={isListed ? String(span_s) : "other"} onChange={({ currentTarget }) => view.span(Number(currentTarget.value))} data-testid="plots-span" data-span-s={span_s}>
        {!isListed && <option value="other">{spanText(span_s)}</option>}
        {SPANS.map((span) => <option key={span.span_s} value={String(span.span_s)}>{span.text}</option>)}
      </select>
      <button type="button" class="mini" title="what the plots show, as a picture" data-testid="plots-png" onClick={() => {
        const element = panel();
        if (element !== null) void withFiles(({ savePicture }) => savePicture(shown, element));
      }}>PNG</button>
      <button type="button" class="mini" title="every sample of the time on show, as a table" data-testid="plots-csv" onClick={() => void withFiles(({ saveTable }) => { saveTable(); })}>CSV</button>
    </div>
  );
}

/** What makes files of plots comes when somebody wants one. */
async function withFiles(make: (files: typeof plotFiles) => Promise<void> | void): Promise<void> {
  try {
    await make(await import("./plot_files"));
  } catch (error) {
    live.report("error", `the plots were not saved: ${error instanceof Error ? error.message : String(error)}`);
  }
}

/** The moment under the cursor, or the time on show while the plots are held. */
function Clock(): JSX.Element {
  const at_s = plotCursor.value === undefined ? undefined : cursorTime_s.value;
  const { held_s, span_s } = plotWindow.value;
  const ends = held_s === undefined ? undefined : stretchOf(plotWindow.value, { oldest_s: live.history.oldest_s, now_s: held_s });
  const places = span_s < 5 ? 3 : 1;
  return (
    <span class="clock faint" data-testid="plots-clock">
      {at_s !== undefined ? `at ${sessionTime(at_s, 3)}` : ends === undefined ? "" : `${sessionTime(Math.max(ends.from_s, 0), places)} – ${sessionTime(ends.to_s, places)}`}
    </span>
  );
}

function spanText(span_s: number): string {
  return span_s < 60 ? `${Number(span_s.toPrecision(2))} s` : `${Number((span_s / 60).toPrecision(2))} min`;
}

/** Draws as time goes on, as often as can be seen. */
function followTime(shown: ReadonlySet<Shown>): () => void {
  let last_ms = Number.NEGATIVE_INFINITY;
  return onFrame((now_ms) => {
    const moment_s = live.momentAt(now_ms);
    if (now_ms - last_ms < LEAST_MS) return;
    last_ms = now_ms;
    passTo(moment_s);
    for (const { draw } of shown) draw();
  });
}

/** The cursor's values in words, or that the plots are held. */
function readingOf(panel: Element | null): string {
  const isHeld = plotWindow.peek().held_s !== undefined;
  if (plotCursor.peek() === undefined) return isHeld ? "held" : "following";
  const captions = [...(panel?.querySelectorAll("figcaption") ?? [])];
  return captions.map((caption) => caption.textContent.replaceAll(/\s+/g, " ").trim()).join("; ");
}
