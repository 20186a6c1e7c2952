// A guided hint: three presses of a button, or the sliders themselves, and a person has seen what delay does and what
// undoes it.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import type { Session } from "../../protocol/session";
import { fixed } from "../format";
import { useFrame } from "../frame";
import { live } from "../store";
import { changesBackTo, changesFor, DELAY_S, outcomes, type Step, stepOf, STEPS, StoryWatch } from "./story_model";

/** Numbers that change faster cannot be read, ms. */
const EVERY_MS = 500;

const ROUND_TRIP = `${2000 * DELAY_S} ms`;

const WORDS: Record<Step, { readonly button: string; readonly title: string; readonly says: string }> = {
  crisp: {
    button: "1 No delay",
    title: "firm clay, position–force, nothing between hand and tool",
    says: "Position goes to the tool, force comes back at once: the hand feels firm clay.",
  },
  late: {
    button: `2 ${ROUND_TRIP}`,
    title: `the same, ${ROUND_TRIP} there and back`,
    says: `Every force is now ${ROUND_TRIP} old. The clay pushes when the hand has already turned, and each swing feeds the next: watch force and velocity.`,
  },
  replica: {
    button: "3 Replica",
    title: "the same clay and the same line; the hand cuts a copy of the clay",
    says: "The line is as long as before, but the hand feels and cuts a copy of the clay where it is. The server checks every cut and follows.",
  },
};

export function Story(): JSX.Element {
  const isOpen = useSignal(false);
  const before = useSignal<Session | undefined>(undefined);
  const step = useComputed(() => (live.session.value === undefined ? undefined : stepOf(live.session.value)));
  const watch = useRef(new StoryWatch());
  const last_ms = useRef(0);
  useFrame((now_ms) => {
    if (!isOpen.peek() || now_ms - last_ms.current < EVERY_MS) return;
    last_ms.current = now_ms;
    const session = live.session.peek();
    if (session !== undefined) watch.current.look(session, live.history, live.momentAt(now_ms));
  });
  const go = (to: Step): void => {
    before.value ??= live.session.peek();
    live.edits.wish(changesFor(to));
  };
  const back = (): void => {
    if (before.value !== undefined) live.edits.wish(changesBackTo(before.value));
    before.value = undefined;
  };
  return (
    <details class="group story" data-testid="story" data-step={step.value} onToggle={({ currentTarget }) => { isOpen.value = currentTarget.open; }}>
      <summary>Feel what delay does, in three steps</summary>
      <div class="steps" role="group" aria-label="Steps">
        {STEPS.map((each) => (
          <button key={each} type="button" title={WORDS[each].title} aria-pressed={step.value === each} onClick={() => go(each)} data-testid={`step-${each}`}>
            {WORDS[each].button}
          </button>
        ))}
      </div>
      <p class="says" data-testid="story-says">
        {step.value === undefined ? "Press 1. It makes the clay firm, so that a late answer has force; “Back” undoes it all." : WORDS[step.value].says}
      </p>
      <Outcomes now={step.value} />
      {before.value !== undefined && <button type="button" class="back" onClick={back} data-testid="story-back">Back to how it was</button>}
    </details>
  );
}

/** What each step came to, as measured, so that they can be compared. */
function Outcomes({ now }: { readonly now: Step | undefined }): JSX.Element | null {
  const measured = outcomes.value;
  if (STEPS.every((step) => measured[step] === undefined)) return now === undefined ? null : <p class="faint">Measuring, for some seconds …</p>;
  return (
    <table class="data" data-testid="story-outcomes">
      <thead>
        <tr>
          <th scope="col">last seconds</th>
          <th scope="col" title="how far the felt force swings about its mean within 0.4 s, root mean square">felt force swings, ± N</th>
          <th scope="col" title="how far the hand's velocity swings about its mean within 0.4 s, root mean square">hand shakes, ± mm/s</th>
        </tr>
      </thead>
      <tbody>
        {STEPS.map((step) => (
          <tr key={step} aria-current={step === now} data-testid={`outcome-${step}`}>
            <th scope="row">{WORDS[step].button}</th>
            <td>{fixed(measured[step]?.felt_n, 2)}</td>
            <td>{fixed(measured[step] === undefined ? undefined : 1000 * measured[step].velocity_m_s, 1)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
