// What the tools do to the clay.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { OPERATIONS, type Operation } from "../../protocol/session";
import { live } from "../store";

const OPERATION_WORDS: Record<Operation, { readonly name: string; readonly says: string }> = {
  cut: { name: "Cut", says: "Tools remove the clay that they pass through." },
  add: { name: "Add", says: "Tools put back clay that was removed, wherever the block has room." },
  smooth: { name: "Smooth", says: "Tools flatten what sticks out and fill what is hollow, where they rub; the volume stays." },
};

export function OperationControls(): JSX.Element {
  const edit = live.edits.of("/operation").value;
  const server = useComputed(() => live.session.value?.operation);
  const keepsCopy = useComputed(() => live.session.value?.scheme === "replica");
  const wished = edit.name === "wished" ? edit.value : server.value;
  const chosen = OPERATIONS.find((operation) => operation === wished);
  return (
    <section class="group" data-edit={edit.name} data-testid="/operation">
      <h2 id="operation">Tools</h2>
      <div class="schemes in-a-row" role="radiogroup" aria-labelledby="operation">
        {OPERATIONS.map((operation) => (
          <label key={operation} title={OPERATION_WORDS[operation].says}>
            <input
              type="radio"
              name="operation"
              value={operation}
              checked={chosen === operation}
              disabled={keepsCopy.value && operation !== "cut"}
              onChange={() => live.edits.wish({ "/operation": operation })}
            />
            <span>{OPERATION_WORDS[operation].name}</span>
          </label>
        ))}
      </div>
      {chosen !== undefined && <p class="faint says">{OPERATION_WORDS[chosen].says}</p>}
      {keepsCopy.value && <p class="faint says">The replica carries cuts alone: another scheme lets tools add and smooth.</p>}
      {edit.name === "refused" && <p class="refusal" role="alert">{edit.detail}</p>}
    </section>
  );
}
