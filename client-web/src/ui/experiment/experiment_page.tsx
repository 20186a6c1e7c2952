// The Experiment page: Fig. 7 of the paper, as a run through the real clay and from the running session, theory over
// both.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import { Choice } from "../choice";
import { download } from "../download";
import { FigureView } from "../figure_view";
import { fixed } from "../format";
import { problemIn } from "../number/refusal";
import { live, theory } from "../store";
import { ExperimentControls, FIELDS } from "./experiment_controls";
import { fig7, liveFig7 } from "./figure";
import { LivePassages, liveRun, LiveStanding, useLiveRun } from "./live_run";
import { request, source } from "./model";
import { plateaus, plateausCsv, traceCsv } from "./table";
import "../style/theory.css";

export function ExperimentPage(): JSX.Element {
  const isLive = source.value === "live";
  useLiveRun();
  // A measured run at once: whoever opens the page sees what it is about. Where nobody answered, coming back asks
  // again.
  const { name } = live.connection.phase.value;
  const answers = name === "open" || name === "empty";
  useEffect(() => {
    const { phase } = theory.cutting.asked.peek();
    if (answers && (phase === "idle" || phase === "away")) theory.cutting.ask(request.peek());
  }, [answers]);
  const content = useComputed(() => {
    if (source.value === "live") return liveFig7(liveRun.path.value, liveRun.passages.value);
    const { answer, question } = theory.cutting.asked.value;
    return fig7(request.value, question, answer);
  });
  return (
    <div class="page experiment" data-asked={theory.cutting.asked.value.phase}>
      <section class="panel fig7" aria-label="Velocity against position">
        <header>
          <h2>Velocity against position</h2>
          <Choice
            name="fig7-source"
            label="What is measured"
            options={[
              { value: "run", text: "a run", title: "the experiment in virtual time, through the same clay as the sessions" },
              { value: "live", text: "running session", title: "the hand of the session on show, as it cuts" },
            ]}
            value={source.value}
            onChoose={(value) => { source.value = value; }}
          />
          <Legend />
        </header>
        <FigureView content={content} test="fig7" label="Velocity of the handle against its position, measured through the clay, with the theory's level in each range" />
        {isLive ? <LiveStanding /> : <RunStanding />}
      </section>
      {isLive ? <LivePassages /> : <Plateaus />}
      <ExperimentControls />
    </div>
  );
}

function Legend(): JSX.Element {
  return (
    <span class="keys">
      <span><i class={`dash ${source.value === "live" ? "live" : "measured"}`} aria-hidden="true" /> {source.value === "live" ? "the session's hand" : "measured"}</span>
      <span><i class="dash theory" aria-hidden="true" /> theory, f_h / (B + ρ B_i)</span>
    </span>
  );
}

/** What the figure shows belongs to, or why it is empty. */
function RunStanding(): JSX.Element {
  const { phase, problem, answer, question } = theory.cutting.asked.value;
  return (
    <div class="standing" aria-live="polite">
      {(phase === "idle" || phase === "asking") && <p><i class="spinner" aria-hidden="true" /> The blade goes through the clay …</p>}
      {phase === "refused" && <p class="refusal" role="alert" data-testid="cutting-refusal">{problem === undefined ? "" : problemIn(FIELDS, problem)}</p>}
      {phase === "away" && <p class="refusal" role="alert">The server did not answer. <em>Run</em> asks it again.</p>}
      {phase === "answered" && answer !== undefined && (
        <p data-testid="cutting-done">
          {fixed(answer.duration_s, 2)} s of cutting, {fixed(answer.removed_volume_m3 * 1e6, 2)} cm³ removed in voxels
          of {fixed(answer.specimen.voxel_size_m * 1000, 2)} mm with a blade {fixed(answer.specimen.blade_width_m * 1000, 1)} mm wide.
        </p>
      )}
      {answer !== undefined && question !== request.value && <p class="faint">The measurement belongs to other settings; <em>Run</em> measures these.</p>}
    </div>
  );
}

function Plateaus(): JSX.Element {
  const { answer, question } = theory.cutting.asked.value;
  const rows = answer === undefined || question === undefined ? [] : plateaus(question, answer);
  return (
    <section class="panel plateaus" aria-label="Plateaus">
      <header>
        <h2>Plateaus</h2>
        <span class="spacer" />
        <button type="button" disabled={answer === undefined} data-testid="plateaus-csv" onClick={() => download("plateaus.csv", "text/csv", plateausCsv(rows))}>
          Table as CSV
        </button>
        <button
          type="button"
          disabled={answer === undefined}
          data-testid="trace-csv"
          onClick={() => {
            if (answer !== undefined) download("trace.csv", "text/csv", traceCsv(answer.trace));
          }}
        >
          Trace as CSV
        </button>
      </header>
      <table class="data">
        <thead>
          <tr>
            <th scope="col">range, cm</th>
            <th scope="col">clay B_i, N·s/m</th>
            <th scope="col">engaged, cm²</th>
            <th scope="col">theory, cm/s</th>
            <th scope="col">measured, cm/s</th>
            <th scope="col">deviation, %</th>
            <th scope="col">ripple, %</th>
          </tr>
        </thead>
        <tbody data-testid="plateaus">
          {rows.length === 0 && <tr><td colSpan={7} class="faint nothing-yet">nothing measured yet</td></tr>}
          {rows.map((row) => (
            <tr key={row.from_m}>
              <th scope="row">{fixed(row.from_m * 100, 1)}–{fixed(row.to_m * 100, 1)}</th>
              <td>{row.clay_damping_n_s_per_m}</td>
              <td>{fixed(row.engaged_area_m2 * 1e4, 2)}</td>
              <td>{fixed(row.theory_m_s * 100, 3)}</td>
              <td>{fixed(row.measured_m_s * 100, 3)}</td>
              <td data-grade={Math.abs(row.deviation) <= 0.02 ? "good" : "bad"}>{fixed(row.deviation * 100, 2)}</td>
              <td data-grade={row.ripple <= 0.02 ? "good" : "bad"}>{fixed(row.ripple * 100, 2)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}
