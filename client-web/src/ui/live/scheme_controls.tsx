// The law that couples handle and tool.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { type Scheme, SCHEMES } from "../../protocol/session";
import { live } from "../store";

const WORDS: Record<Scheme, { name: string; says: string }> = {
  force_exchange: { name: "Force exchange", says: "Each side moves by both forces. Stable at most delays, but hand and tool drift apart." },
  position_force: { name: "Position–force", says: "Position goes up, force comes back. Crisp without delay, unstable with it." },
  wave: { name: "Wave variables", says: "Passive at any delay; the longer the line, the softer stiff clay feels." },
  tdpa: { name: "Time-domain passivity", says: "Watches the energy of the line and dissipates what it would add." },
  replica: { name: "Replica", says: "The hand cuts a copy of the clay without any delay; the server stays the authority." },
};

export function SchemeControls(): JSX.Element {
  const edit = live.edits.of("/scheme").value;
  const server = useComputed(() => live.session.value?.scheme);
  const chosen = edit.name === "wished" ? edit.value : server.value;
  const chosenScheme = SCHEMES.find((scheme) => scheme === chosen);
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
              checked={chosenScheme === scheme}
              onChange={() => live.edits.wish({ "/scheme": scheme })}
            />
            <span>{WORDS[scheme].name}</span>
          </label>
        ))}
      </div>
      {chosenScheme !== undefined && <p class="faint says">{WORDS[chosenScheme].says}</p>}
      {edit.name === "refused" && <p class="refusal" role="alert">{edit.detail}</p>}
    </section>
  );
}
