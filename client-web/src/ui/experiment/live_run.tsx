// Fig. 7 from the session on show: its curve as it goes on, and what each passage through the stepped block came to.

import { computed, signal, type ReadonlySignal } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import type { Session } from "../../protocol/session";
import { Channel } from "../../protocol/telemetry";
import { fixed } from "../format";
import { useFrame } from "../frame";
import { live, openSession } from "../store";
import { settings, source } from "./model";
import { type LivePath, type Passage, passageOf, rangesOfSession, startOf } from "./passing";

/** As much as the history keeps, and as finely as a plateau needs. */
const SPAN_S = 15;
const STEP_S = 0.005;
/** The eye follows no faster, ms. */
const EVERY_MS = 120;

const NOTHING: LivePath = { position_m: [], velocity_m_s: [], hand_force_n: [], height_m: [] };

/** They outlive the page, so that coming back shows the last passage, until the clay is another. */
const path = signal<LivePath>(NOTHING);
const kept = signal<{ readonly block: string; readonly passages: readonly Passage[] }>({ block: "", passages: [] });
const passages = computed(() => kept.value.passages);

/** The session's curve, and its passages through the stepped block. */
export const liveRun: { readonly path: ReadonlySignal<LivePath>; readonly passages: ReadonlySignal<readonly Passage[]> } = { path, passages };

/** Follows the session on show for as long as the figure is to show it. */
export function useLiveRun(): void {
  const last_ms = useRef(0);
  useFrame((now_ms) => {
    if (source.peek() !== "live" || now_ms - last_ms.current < EVERY_MS) return;
    last_ms.current = now_ms;
    look(now_ms);
  });
}

function look(now_ms: number): void {
  const session = live.session.peek();
  if (session === undefined) return;
  path.value = pathOf(session, now_ms);
  const { virtual_damping_n_s_per_m, force_ratio } = settings.peek();
  const law = { virtual_damping_n_s_per_m, force_ratio, position_ratio: session.position_ratio };
  // A passage that has scrolled out of the history stays in the table for as long as its clay is there.
  const block = `${session.id} ${session.clay.epoch} ${session.clay.initial_units}`;
  const before = kept.peek().block === block ? kept.peek().passages : [];
  const now = rangesOfSession(session).map((range, n) => {
    const passage = passageOf(range, path.peek(), law);
    return passage.measured_m_s === undefined ? (before.at(n) ?? passage) : passage;
  });
  kept.value = { block, passages: now };
}

function pathOf(session: Session, now_ms: number): LivePath {
  const tool = live.tool.peek();
  if (tool === undefined) return NOTHING; // nobody has held it yet, or not any more
  const until_s = live.momentAt(now_ms);
  const along = (channel: number, axis: number): number[] =>
    live.history.path(channel, until_s, SPAN_S, STEP_S).filter((_, n) => n % 3 === axis);
  const start_m = startOf(session, tool);
  return {
    position_m: along(Channel.handle_position_m, 0).map((x) => x - start_m),
    velocity_m_s: along(Channel.handle_velocity_m_s, 0),
    hand_force_n: along(Channel.hand_force_n, 0),
    height_m: along(Channel.tool_position_m, 2),
  };
}

/** The session that cuts as the paper did. */
const SESSION = "fig7";

/** Makes it, unless it is there, and shows it. */
async function openExperiment(): Promise<void> {
  if (!live.connection.sessions.peek().includes(SESSION)) {
    const outcome = await live.api.create({
      id: SESSION,
      tool: { kind: "blade", width_m: 0.01, height_m: 0.04, thickness_m: 0.002 },
      clay: { shape: { kind: "stepped" } },
    });
    if (outcome.kind !== "done") {
      refusal.value = outcome.kind === "problem" ? outcome.problem.detail : "the server did not answer";
      return;
    }
  }
  refusal.value = undefined;
  openSession(SESSION);
}

const refusal = signal<string | undefined>(undefined);

/** What is cut, and what one has to do to see the experiment. */
export function LiveStanding(): JSX.Element {
  const session = live.session.value;
  const isStepped = session !== undefined && 0 < rangesOfSession(session).length;
  return (
    <div class="standing" aria-live="polite" data-testid="live-standing">
      {session === undefined
        ? <p>No session to follow.</p>
        : (
          <p>
            Session {session.id}, viscosity <span data-testid="live-viscosity">{fixed(session.material.viscosity_pa_s_per_m / 1000, 0)}</span> kPa·s/m.
            {isStepped
              ? " The theory is that of whole clay, for the force that the hand had in each range."
              : " It cuts no stepped block with a blade, so there is no theory to lay over its curve."}
          </p>
        )}
      {isStepped
        ? (
          <p class="act">
            <button type="button" class="small" data-testid="stepped" onClick={() => void live.resetClay(undefined)}>Fresh block</button>
            <span class="faint">An even push makes it Fig. 7: <code>teleclay-handle --session {session.id} --intent sensor-force --force-n 2,0,0</code></span>
          </p>
        )
        : (
          <p class="act">
            <button type="button" class="small" data-testid="open-experiment" onClick={() => void openExperiment()}>Open the experiment's session</button>
            <span class="faint">a stepped block and a blade 1 cm wide</span>
          </p>
        )}
      {refusal.value !== undefined && <p class="refusal" role="alert">{refusal.value}</p>}
    </div>
  );
}

export function LivePassages(): JSX.Element {
  return (
    <section class="panel plateaus" aria-label="Passages">
      <header><h2>Newest passage through each range</h2></header>
      <table class="data">
        <thead>
          <tr>
            <th scope="col">range, cm</th>
            <th scope="col">clay B_i, N·s/m</th>
            <th scope="col">engaged, cm²</th>
            <th scope="col">hand f_h, N</th>
            <th scope="col">theory, cm/s</th>
            <th scope="col">measured, cm/s</th>
            <th scope="col">deviation, %</th>
          </tr>
        </thead>
        <tbody data-testid="passages">
          {passages.value.length === 0 && <tr><td colSpan={7} class="faint nothing-yet">no stepped block in this session</td></tr>}
          {passages.value.map((row) => <PassageRow key={row.from_m} row={row} />)}
        </tbody>
      </table>
    </section>
  );
}

function PassageRow({ row }: { readonly row: Passage }): JSX.Element {
  const { theory_m_s: theory, measured_m_s: measured, engaged_area_m2: area } = row;
  const deviation = theory === undefined || measured === undefined || theory === 0 ? undefined : measured / theory - 1;
  return (
    <tr>
      <th scope="row">{fixed(row.from_m * 100, 1)}–{fixed(row.to_m * 100, 1)}</th>
      <td>{fixed(area === undefined ? undefined : area * row.viscosity_pa_s_per_m, 1)}</td>
      <td>{fixed(area === undefined ? undefined : area * 1e4, 2)}</td>
      <td>{fixed(row.hand_force_n, 2)}</td>
      <td>{fixed(theory === undefined ? undefined : theory * 100, 3)}</td>
      <td>{fixed(measured === undefined ? undefined : measured * 100, 3)}</td>
      <td>{fixed(deviation === undefined ? undefined : deviation * 100, 1)}</td>
    </tr>
  );
}
