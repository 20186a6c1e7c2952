// The Stability page: gains, clay and delay on sliders; what the loop does with them, how near it is to doing something
// else, and why.

import { computed, useComputed, useSignal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import type { FigurePoint } from "../../plots/figure";
import { theory } from "../store";
import { Choice } from "../choice";
import { FigureView } from "../figure_view";
import { loadMathematics, mathematics, mathematicsMissing } from "../mathematics";
import { type DelayedLoop, loopOf } from "../../theory/loop";
import { verdictOf, type Verdict } from "../../theory/verdict";
import {
  bodeMagnitude, bodePhase, type Curve, curveOf, describeAt, describeCurve, type LoopName, nyquist, spanOf, ZOOMS, type Zoom,
} from "./figures";
import { BODE_KEYS, cursorAfter } from "./bode_keys";
import { partsOf, question, round_trip_s, settings } from "./model";
import { Margins } from "./margins";
import { problemIn } from "../number/refusal";
import { FIELDS, StabilityControls } from "./stability_controls";
import "../style/theory.css";

const WORDS: readonly { readonly value: LoopName; readonly text: string; readonly title: string }[] = [
  { value: "open", text: "no delay", title: "L = P (T_h + ρ T_t), what (33) asks about" },
  { value: "position_force", text: "position–force", title: "E exp(−s d) / (1 + H): position goes forward, force comes back, at the slider's round trip" },
  { value: "force_exchange", text: "force exchange", title: "−H E exp(−s d) / ((1 + E)(1 + H)): the paper's own, at the slider's round trip" },
];

let before: DelayedLoop | undefined;
/** The loop of the settings; of the last ones that made a loop, where these make none. */
const delayed = computed((): DelayedLoop | undefined => {
  const module = mathematics.value;
  before = (module === undefined ? undefined : loopOf(module, partsOf(settings.value))) ?? before;
  return before;
});

/** What there is to say, as soon as there is an answer; it follows the delay without asking again. */
const verdict = computed((): Verdict | undefined => {
  const { answer } = theory.loop.asked.value;
  return answer === undefined || delayed.value === undefined ? undefined : verdictOf(answer, delayed.value, round_trip_s.value);
});

export function StabilityPage(): JSX.Element {
  useEffect(() => void loadMathematics(), []);
  useSignalEffect(() => theory.loop.ask(question.value));
  const loop = useSignal<LoopName>("position_force");
  const zoom = useSignal<Zoom>("near");
  const at_rad_s = useSignal<number | undefined>(undefined);
  const curve = useComputed((): Curve | undefined => {
    const { answer } = theory.loop.asked.value;
    return answer === undefined ? undefined : curveOf(loop.value, answer, delayed.value, round_trip_s.value);
  });
  const drawn = <T,>(draw: (curve: Curve, answer: NonNullable<typeof theory.loop.asked.value.answer>) => T): T | undefined => {
    const { answer } = theory.loop.asked.value;
    return answer === undefined || curve.value === undefined ? undefined : draw(curve.value, answer);
  };
  const nyquistFigure = useComputed(() => drawn((c, answer) => nyquist(loop.value, c, answer, zoom.value, at_rad_s.value)));
  const magnitude = useComputed(() => drawn((c, answer) => bodeMagnitude(loop.value, c, answer, at_rad_s.value)));
  const phase = useComputed(() => drawn((c) => bodePhase(loop.value, c, at_rad_s.value)));
  const onBode = (at: FigurePoint | undefined): void => {
    at_rad_s.value = at?.x;
  };
  /** Spoken where a key has moved the cursor. */
  const spoken = useSignal("");
  const onKeyDown = (event: KeyboardEvent): void => {
    if (curve.value === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    const next = cursorAfter(event, at_rad_s.value, spanOf(curve.value));
    if (next === "other") return;
    event.preventDefault();
    at_rad_s.value = next;
    spoken.value = next === undefined ? "no cursor" : describeAt(curve.value, next);
  };
  const { phase: asked } = theory.loop.asked.value;
  const named = WORDS.find(({ value }) => value === loop.value);

  return (
    <div class="page stability" data-asked={asked}>
      <Sentence />
      <section class="panel nyquist" aria-label="Nyquist diagram">
        <header>
          <h2>Nyquist</h2>
          <Choice name="loop" label="Which loop" options={WORDS} value={loop.value} onChoose={(name) => { loop.value = name; }} />
          <span class="spacer" />
          <Choice
            name="zoom"
            label="How near"
            options={ZOOM_NAMES.map((value) => ({ value, text: `±${ZOOMS[value]}` }))}
            value={zoom.value}
            onChoose={(value) => { zoom.value = value; }}
          />
        </header>
        <FigureView content={nyquistFigure} test="nyquist" label={curve.value === undefined ? "Nyquist diagram" : describeCurve(loop.value, curve.value, round_trip_s.value)} />
      </section>
      <section class="panel bode" aria-label="Bode diagram">
        <header><h2>Bode</h2><span class="faint" title={named?.title}>{named?.title.split(/[:,]/)[0]}</span></header>
        <div class="curves" role="application" aria-label="Cursor of the Bode diagram" aria-describedby="bode-keys" tabIndex={0} onKeyDown={onKeyDown} data-testid="bode-curves">
          <FigureView content={magnitude} test="bode-magnitude" label="Bode diagram, magnitude over frequency" onPointer={onBode} />
          <FigureView content={phase} test="bode-phase" label="Bode diagram, phase over frequency" onPointer={onBode} />
        </div>
        <p class="hidden" id="bode-keys">Keys: {BODE_KEYS}.</p>
        <p class="hidden" aria-live="polite" data-testid="bode-reading">{spoken.value}</p>
      </section>
      <Margins verdict={verdict} />
      <StabilityControls />
    </div>
  );
}

const ZOOM_NAMES: readonly Zoom[] = ["near", "mid", "far"];

/** What happens and why, in plain words. */
function Sentence(): JSX.Element {
  const { phase, problem, answer } = theory.loop.asked.value;
  const now = verdict.value;
  const calm = mathematicsMissing.value === undefined ? now?.schemes.every(({ isStable }) => isStable) : false;
  return (
    <section class="panel sentence" aria-live="polite" data-calm={calm}>
      <p class="headline" data-testid="verdict" role={mathematicsMissing.value === undefined ? undefined : "alert"}>{now?.headline ?? mathematicsMissing.value ?? (phase === "away" ? "The server does not answer." : "Asking the server …")}</p>
      {now?.schemes.map(({ scheme, because, isStable }) => (
        <p key={scheme} class="because" data-stable={isStable}>
          <i class={`dash ${scheme}`} aria-hidden="true" /> {because}
        </p>
      ))}
      {phase === "refused" && <p class="refusal" role="alert">{problem === undefined ? "" : problemIn(FIELDS, problem)}{answer === undefined ? "" : " What is shown belongs to the last values that were taken."}</p>}
      {phase === "away" && answer !== undefined && <p class="refusal" role="alert">The server does not answer; what is shown belongs to the last values that were taken.</p>}
    </section>
  );
}
