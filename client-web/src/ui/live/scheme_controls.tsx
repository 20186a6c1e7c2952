// The law that couples handle and tool.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { type Scheme, SCHEMES } from "../../protocol/session";
import { live } from "../store";

const WORDS: Record<Scheme, { name: string; says: string }> = {
  force_exchange: { name: "Force exchange", says: "each side integrates both forces; drifts apart under delay" },
  position_force: { name: "Position–force", says: "position up, force back; unstable under delay" },
  wave: { name: "Wave variables", says: "passive at any delay; stiff clay feels soft" },
  tdpa: { name: "Time-domain passivity", says: "dissipates what the line would add" },
  replica: { name: "Replica", says: "the hand cuts its own copy; no line to feel" },
};

export function SchemeControls(): JSX.Element {
  const edit = live.edits.of("/scheme").value;
  const server = useComputed(() => live.session.value?.scheme);
  const chosen = edit.name === "wished" ? edit.value : server.value;
  return (
    <section class="group" data-edit={edit.name} data-testid="/scheme">
      <h2 id="scheme">Scheme</h2>
      <div class="schemes" role="radiogroup" aria-labelledby="scheme">
        {SCHEMES.map((scheme) => (
          <label key={scheme} title={WORDS[scheme].says}>
            <input
              type="radio"
              name="scheme"
              value={scheme}
              checked={chosen === scheme}
              onChange={() => live.edits.wish({ "/scheme": scheme })}
            />
            <span>{WORDS[scheme].name}</span>
            <small>{WORDS[scheme].says}</small>
          </label>
        ))}
      </div>
      {edit.name === "refused" && <p class="refusal" role="alert">{edit.detail}</p>}
    </section>
  );
}
