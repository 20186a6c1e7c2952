// A card over the picture when there is a reason why nothing moves.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { live } from "../store";
import { stopWords } from "./operate/words";

export function SituationCard(): JSX.Element | null {
  const state = useComputed(() => live.session.value?.state);
  const anyone = useComputed(() => live.session.value?.tools.some(({ connected }) => connected) ?? false);
  const id = useComputed(() => live.session.value?.id);
  const stop = useComputed(() => live.session.value?.stop);
  if (!live.isCurrent.value || state.value === undefined) return null;
  if (state.value === "stopped") {
    return (
      <div class="situation stopped" role="alert" data-testid="situation">
        <strong>Stopped</strong>
        <p>{stop.value === undefined || stop.value === null ? "The session is stopped." : stopWords(stop.value)}</p>
        <p>Nothing moves until the stop is cleared and each operator takes a tool and takes hold anew.</p>
      </div>
    );
  }
  if (state.value === "paused") {
    return (
      <div class="situation" role="status" data-testid="situation">
        <strong>Paused</strong>
        <p>The tool rests and renders nothing.</p>
      </div>
    );
  }
  if (anyone.value) return null;
  return (
    <div class="situation" role="status" data-testid="situation">
      <strong>No operator connected</strong>
      <p>Press <em>Operate</em> to take the tool here, or join with <code>teleclay-handle --session {id.value}</code></p>
    </div>
  );
}
