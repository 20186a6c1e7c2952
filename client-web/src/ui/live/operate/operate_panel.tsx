// To operate: who one is, which tool, and the stop. What is held, why nothing moves, and how the hand is set.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { hindrance } from "../../../state/manners";
import { live, operating } from "../../store";
import { HandReadings } from "./hand_readings";
import { HandSettings } from "./hand_settings";
import { clearStop, LONGEST_NAME, NOBODY, operatorName, rows, said, setName, stop, takeTool } from "./operator";
import { ToolRows } from "./tool_rows";
import { linesOf, saidOf, stopWords } from "./words";

export function OperatePanel(): JSX.Element {
  const isHere = useComputed(() => live.session.value !== undefined);
  const isHeld = useComputed(() => operating.standing.value.name === "in");
  return (
    <section class="panel operate" aria-label="Operate" data-standing={operating.standing.value.name} data-testid="operating">
      <header>
        <h2>Operate</h2>
        <button type="button" class="stop" disabled={!isHere.value} onClick={() => void stop()} title="takes every tool of the session away, until the stop is cleared" data-testid="stop">
          ■ Stop
        </button>
      </header>
      <Stopped />
      <Taking />
      <ToolRows />
      <Lines />
      {isHeld.value && <HandReadings />}
      {isHeld.value && <HandSettings />}
    </section>
  );
}

function Stopped(): JSX.Element | null {
  const latched = useComputed(() => live.session.value?.stop ?? undefined);
  if (latched.value === undefined) return null;
  return (
    <div class="latched" role="alert" data-testid="stopped">
      <p><strong>Stopped.</strong> {stopWords(latched.value)}</p>
      <p>Once it is cleared nothing moves by itself: each operator takes a tool and takes hold anew.</p>
      <button type="button" onClick={() => void clearStop()} data-testid="clear-stop">Clear the stop</button>
    </div>
  );
}

function Taking(): JSX.Element {
  const standing = operating.standing.value;
  const isOut = standing.name === "out";
  return (
    <form
      class="taking"
      onSubmit={(event) => {
        event.preventDefault();
        if (operating.standing.peek().name === "out") takeTool();
        else document.querySelector<HTMLElement>("[data-testid=scene]")?.focus();
      }}
    >
      <label>
        <span>name</span>
        <input
          type="text"
          value={operatorName.value}
          maxLength={LONGEST_NAME}
          placeholder={NOBODY}
          autocomplete="nickname"
          spellcheck={false}
          readOnly={!isOut}
          title={isOut ? "as others see who holds a tool" : "the tool is held under this name"}
          onInput={({ currentTarget }) => setName(currentTarget.value)}
          data-testid="operator"
        />
      </label>
      <button type="submit" class="primary" title={isOut ? "takes a tool; nothing moves until you take hold" : "puts the keyboard's focus on the picture"} data-testid="operate">
        {BUTTONS[standing.name]}
      </button>
      {!isOut && (
        <button type="button" onClick={() => operating.release()} disabled={standing.name === "leaving"} title="gives the tool back" data-testid="release">Release</button>
      )}
    </form>
  );
}

const BUTTONS = { out: "Operate", asking: "Asking …", in: "To the hand", again: "Asking again …", leaving: "Leaving …" } as const;

/** What is to be said, the gravest first. */
function Lines(): JSX.Element {
  const standing = operating.standing.value;
  const lines = useComputed(() => linesOf(operating.standing.value, operating.hand.value, operating.letGo.value));
  const why = useComputed(() => (live.session.value === undefined ? undefined : hindrance(live.session.value, rows.value)));
  const because = standing.name === "out" && standing.because !== undefined ? [saidOf(standing.because)] : [];
  const isStopped = useComputed(() => live.session.value?.state === "stopped");
  return (
    <div class="lines" aria-live="polite" data-testid="operate-says">
      {[...because, ...lines.value].map(({ key, level, says }) => <p key={key} data-level={level} data-line={key}>{says}</p>)}
      {standing.name === "out" && !isStopped.value && why.value !== undefined && <p data-line="hindrance">{why.value}</p>}
      {said.value !== undefined && <p data-level="warn" data-line="answer">{said.value}</p>}
    </div>
  );
}
