// The Experiment page: Fig. 7 of the paper, as a run through the real clay and from the running session, theory over both.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { Channel } from "../../protocol/telemetry";
import { download } from "../download";
import { FigureView } from "../figure_view";
import { fixed } from "../format";
import { useFrame } from "../frame";
import { live, theory } from "../store";
import { ExperimentControls } from "./experiment_controls";
import { fig7, type LivePath } from "./figure";
import { request } from "./model";
import { plateaus, plateausCsv, traceCsv } from "./table";

/** How much of the running session is drawn, and how finely. */
const LIVE_SPAN_S = 12;
const LIVE_STEP_S = 0.01;
/** The eye follows no faster, ms. */
const LIVE_EVERY_MS = 80;

export function ExperimentPage(): JSX.Element {
  const withLive = useSignal(false);
  const path = useSignal<LivePath | undefined>(undefined);
  useLivePath(withLive.value, (next) => { path.value = next; });
  const content = useComputed(() => {
    const { answer, question } = theory.cutting.asked.value;
    return fig7(request.value, question, answer, withLive.value ? path.value : undefined);
  });
  return (
    <div class="page experiment" data-asked={theory.cutting.asked.value.phase}>
      <section class="panel fig7" aria-label="Velocity against position">
        <header>
          <h2>Velocity against position</h2>
          <Legend withLive={withLive.value} />
          <span class="spacer" />
          <label class="check">
            <input type="checkbox" checked={withLive.value} onChange={({ currentTarget }) => { withLive.value = currentTarget.checked; }} data-testid="with-live" />
            <span>with the running session</span>
          </label>
        </header>
        <FigureView content={content} test="fig7" label="Velocity of the handle against its position, measured through the clay, with the theory's level in each range" />
        <Standing withLive={withLive.value} />
      </section>
      <Plateaus />
      <ExperimentControls />
    </div>
  );
}

function Legend({ withLive }: { withLive: boolean }): JSX.Element {
  return (
    <span class="keys">
      <i class="dash measured" aria-hidden="true" /> measured
      <i class="dash theory" aria-hidden="true" /> theory, f_h / (B + ρ B_i)
      {withLive && <><i class="dash live" aria-hidden="true" /> running session</>}
    </span>
  );
}

/** What the figure shows belongs to, or why it is empty. */
function Standing({ withLive }: { withLive: boolean }): JSX.Element {
  const { phase, problem, answer, question } = theory.cutting.asked.value;
  const stepped = useComputed(() => live.session.value?.clay.shape.kind === "stepped");
  return (
    <div class="standing" aria-live="polite">
      {phase === "idle" && <p>The theory alone so far. <em>Run</em> cuts the stepped block in virtual time, through the same clay as the sessions.</p>}
      {phase === "asking" && <p><i class="spinner" aria-hidden="true" /> The blade goes through the clay …</p>}
      {phase === "refused" && <p class="refusal" role="alert" data-testid="cutting-refusal">{problem?.detail}</p>}
      {phase === "away" && <p class="refusal" role="alert">The server did not answer.</p>}
      {phase === "answered" && answer !== undefined && (
        <p data-testid="cutting-done">
          {fixed(answer.duration_s, 2)} s of cutting, {fixed(answer.removed_volume_m3 * 1e6, 2)} cm³ removed in voxels
          of {fixed(answer.specimen.voxel_size_m * 1000, 2)} mm with a blade {fixed(answer.specimen.blade_width_m * 1000, 1)} mm wide.
        </p>
      )}
      {answer !== undefined && question !== request.value && <p class="faint">The measurement belongs to other settings; <em>Run</em> measures these.</p>}
      {withLive && !stepped.value && <p class="faint">The session cuts a plain block: “stepped” on the Live page makes it the experiment's.</p>}
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
            <th scope="col">range</th>
            <th scope="col">clay B_i</th>
            <th scope="col">engaged</th>
            <th scope="col">theory</th>
            <th scope="col">measured</th>
            <th scope="col">deviation</th>
            <th scope="col">ripple</th>
          </tr>
        </thead>
        <tbody data-testid="plateaus">
          {rows.length === 0 && <tr><td colSpan={7} class="faint">nothing measured yet</td></tr>}
          {rows.map((row) => (
            <tr key={row.from_m}>
              <th scope="row">{fixed(row.from_m * 100, 1)}–{fixed(row.to_m * 100, 1)} <small>cm</small></th>
              <td>{row.clay_damping_n_s_per_m} <small>N·s/m</small></td>
              <td>{fixed(row.engaged_area_m2 * 1e4, 2)} <small>cm²</small></td>
              <td>{fixed(row.theory_m_s * 100, 3)} <small>cm/s</small></td>
              <td>{fixed(row.measured_m_s * 100, 3)} <small>cm/s</small></td>
              <td data-grade={Math.abs(row.deviation) <= 0.02 ? "good" : "bad"}>{fixed(row.deviation * 100, 2)} <small>%</small></td>
              <td data-grade={row.ripple <= 0.02 ? "good" : "bad"}>{fixed(row.ripple * 100, 2)} <small>%</small></td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

/** The last seconds of the session on show, in handle positions that fit the experiment's edges. */
function useLivePath(wanted: boolean, onPath: (path: LivePath) => void): void {
  const last_ms = useSignal(0);
  useFrame((now_ms) => {
    if (!wanted || now_ms - last_ms.peek() < LIVE_EVERY_MS) return;
    last_ms.value = now_ms;
    const session = live.session.peek();
    const tool = live.tool.peek();
    if (session === undefined || tool === undefined) return;
    const until_s = live.momentAt(now_ms);
    const positions = live.history.path(Channel.handle_position_m, until_s, LIVE_SPAN_S, LIVE_STEP_S);
    const velocities = live.history.path(Channel.handle_velocity_m_s, until_s, LIVE_SPAN_S, LIVE_STEP_S);
    // The experiment counts from where the block begins, and its edges are handle positions.
    const offset_m = tool.home_m[0] / session.position_ratio;
    onPath({ position_m: along(positions).map((x) => x + offset_m), velocity_m_s: along(velocities) });
  });
}

/** The x of x, y, z, x, y, z, … */
function along(vectors: readonly number[]): number[] {
  return vectors.filter((_, n) => n % 3 === 0);
}
