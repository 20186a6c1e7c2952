// The law that couples handle and tool.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { SCHEMES } from "../../protocol/session";
import { SCHEME_WORDS } from "../scheme_words";
import { live } from "../store";

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
          <label key={scheme} title={SCHEME_WORDS[scheme].says}>
            <input
              type="radio"
              name="scheme"
              value={scheme}
              checked={chosenScheme === scheme}
              onChange={() => live.edits.wish({ "/scheme": scheme })}
            />
            <span>{SCHEME_WORDS[scheme].name}</span>
          </label>
        ))}
      </div>
      {chosenScheme !== undefined && <p class="faint says">{SCHEME_WORDS[chosenScheme].says}</p>}
      {edit.name === "refused" && <p class="refusal" role="alert">{edit.detail}</p>}
    </section>
  );
}
