// Everything that can be changed while the loop runs.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { ClayShape } from "../../protocol/session";
import { fixed } from "../format";
import { live } from "../store";
import { ClayFiles } from "./clay_files";
import { MaterialControls } from "./material_controls";
import { NetworkControls } from "./network_controls";
import { OperationControls } from "./operation_controls";
import { Recordings } from "./recordings";
import { SchemeControls } from "./scheme_controls";
import { Story } from "./story";

export function Controls(): JSX.Element {
  return (
    <fieldset class="panel controls" disabled={!live.isCurrent.value || live.session.value === undefined} aria-label="Controls">
      <RunControls />
      <ClayFiles />
      <Recordings />
      <ToolChoice />
      <Story />
      <SchemeControls />
      <NetworkControls />
      <OperationControls />
      <MaterialControls />
      <Notices />
    </fieldset>
  );
}

function RunControls(): JSX.Element {
  const edit = live.edits.of("/paused").value;
  const serverPaused = useComputed(() => live.session.value?.state === "paused");
  const refusal = useSignal<string | undefined>(undefined);
  const paused = edit.name === "wished" ? edit.value === true : serverPaused.value;
  const fresh = async (shape: ClayShape): Promise<void> => {
    const outcome = await live.resetClay(shape);
    refusal.value = outcome.kind === "problem" ? outcome.problem.detail : outcome.kind === "away" ? "the server did not answer" : undefined;
  };
  const said = edit.name === "refused" ? edit.detail : refusal.value;
  return (
    <section class="group run" aria-label="Run">
      <button
        type="button"
        class="primary"
        data-edit={edit.name}
        aria-pressed={paused}
        onClick={() => live.edits.wish({ "/paused": !paused })}
        data-testid="pause"
      >
        {paused ? "▶ Resume" : "❙❙ Pause"}
      </button>
      <span class="pair" role="group" aria-label="Fresh clay">
        <button type="button" onClick={() => void fresh({ kind: "block" })} title="a fresh block of 128 × 64 × 64 mm" data-testid="fresh-block">
          Fresh block
        </button>
        <button type="button" onClick={() => void fresh({ kind: "stepped" })} title="the cutting experiment's block: three steps of rising depth" data-testid="fresh-stepped">
          stepped
        </button>
      </span>
      {said !== undefined && <p class="refusal" role="alert">{said}</p>}
    </section>
  );
}

/** Which operator's tool the picture and the plots follow, when there are several. */
function ToolChoice(): JSX.Element | null {
  const count = useComputed(() => live.session.value?.tools.length ?? 0);
  if (count.value < 2) return null;
  const list = live.session.value?.tools ?? [];
  return (
    <section class="group">
      <label class="choice">
        <span>follow</span>
        <select value={live.tool.value?.id} onChange={({ currentTarget }) => live.showTool(Number(currentTarget.value))}>
          {list.map(({ id, operator, connected }) => (
            <option key={id} value={id}>tool {id} · {operator === "" ? "nobody yet" : operator}{connected || operator === "" ? "" : ", gone"}</option>
          ))}
        </select>
      </label>
    </section>
  );
}

function Notices(): JSX.Element {
  const notices = live.notices.value;
  return (
    <section class="group notices" aria-label="Events" tabIndex={0}>
      <h2>Events</h2>
      {notices.length === 0 && <p class="faint">nothing yet</p>}
      <ol aria-live="polite">
        {notices.map(({ id, level, text, time_s }) => (
          <li key={id} data-level={level}>
            <time>{time_s === undefined ? "" : `${fixed(time_s, 1)} s`}</time> {text}
          </li>
        ))}
      </ol>
    </section>
  );
}
