// A card over the picture while that shows another moment than now: which, and what one can do there.

import type { JSX } from "preact";
import { clock, fixed } from "../format";
import { live, past, timeLine } from "../store";
import { type TakenBack, takenBackFrom } from "./time_line_model";

export function PastCard(): JSX.Element | null {
  const moment = past.moment.value;
  if (moment.name === "now") return null;
  const { at_s } = moment;
  const taken = takenBackFrom(at_s, timeLine.strokes.value?.strokes ?? []);
  const goOn = async (): Promise<void> => {
    if (taken !== undefined && (await timeLine.undo({ since: taken.since }))) past.backToNow();
  };
  return (
    <div class="situation past" data-testid="past" data-moment={moment.name}>
      <strong role="status">
        {moment.name === "asked" && <><i class="spinner" aria-hidden="true" /> Looking back to {momentWords(at_s)} …</>}
        {moment.name === "shown" && <>As it was at {momentWords(at_s)}</>}
        {moment.name === "refused" && <>The clay at {momentWords(at_s)} cannot be shown</>}
      </strong>
      {moment.name === "refused" && <p class="refusal" role="alert">{moment.because}</p>}
      {moment.name !== "refused" && <p>{takenWords(taken)}</p>}
      <p class="answers">
        <button
          type="button"
          disabled={taken === undefined || moment.name !== "shown" || timeLine.isBusy.value || !live.isCurrent.value}
          onClick={() => void goOn()}
          title={`${takenWords(taken)} Redo brings it back, stroke by stroke.`}
          data-testid="go-on-from-here"
        >
          Go on from here
        </button>
        <button type="button" class="primary" onClick={() => past.backToNow()} data-testid="back-to-now">Back to now</button>
      </p>
    </div>
  );
}

function momentWords(at_s: number): string {
  return `${fixed(at_s, 1)} s${at_s < 60 ? "" : ` (${clock(at_s)})`}`;
}

/** What going on from there would mean. */
function takenWords(taken: TakenBack | undefined): string {
  if (taken === undefined) return "Nothing was cut since that is not undone.";
  const { count, hadBegun } = taken;
  if (count === 1) return hadBegun ? "In the middle of the last stroke: going on takes back the whole of it." : "Going on from here takes back one stroke.";
  return `Going on from here takes back ${count} strokes${hadBegun ? ", the one under way as a whole" : ""}.`;
}
