// A card over the picture when there is a reason why nothing moves.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { live } from "../store";

export function SituationCard(): JSX.Element | null {
  const state = useComputed(() => live.session.value?.state);
  const anyone = useComputed(() => live.session.value?.tools.some(({ connected }) => connected) ?? false);
  const id = useComputed(() => live.session.value?.id);
  if (!live.isCurrent.value || state.value === undefined) return null;
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
      <p>Join with <code>teleclay-handle --session {id.value}</code></p>
    </div>
  );
}
