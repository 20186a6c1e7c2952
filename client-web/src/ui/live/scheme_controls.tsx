// The law that couples handle and tool, and how the hand's copy of the clay does where there is one.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { SCHEMES, type ToolState } from "../../protocol/session";
import { count, fixed } from "../format";
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
      {server.value === "replica" && <CopyLine />}
      {edit.name === "refused" && <p class="refusal" role="alert">{edit.detail}</p>}
    </section>
  );
}

const COPY_WORDS: Record<ToolState["copy"], { readonly grade: "good" | "warn"; readonly says: string }> = {
  none: { grade: "warn", says: "The hand has no copy of the clay yet." },
  live: { grade: "good", says: "The hand's copy is live: felt and cut at once." },
  stale: { grade: "warn", says: "No news for too long: the copy is felt, but no longer cut." },
  diverged: { grade: "warn", says: "The copy differs from the server's clay: the parts that differ are on their way." },
};

const REFUSAL_WORDS: Record<ToolState["refusal"], string> = {
  none: "",
  out_of_reach: "out of the tool's reach",
  too_fast: "faster than the speed limit",
  wrong_owner: "meant for an earlier server of the session",
  wrong_epoch: "in an earlier block of clay",
  paused: "while the session was paused",
  fault: "while the tool was in fault",
};

/** What the copy is good for, and what it hides. */
function CopyLine(): JSX.Element | null {
  const tool = live.tool.value;
  if (tool?.connected !== true) return null;
  const { grade, says } = COPY_WORDS[tool.copy];
  const { sweeps_refused: refused, refusal } = tool;
  const reason = refusal === "none" ? "" : `: ${refused === 1 ? "" : "the last was "}${REFUSAL_WORDS[refusal]}`;
  return (
    <>
      <p class="copy" data-grade={grade} data-testid="copy" data-copy={tool.copy}>
        <i class="dot" aria-hidden="true" /> {says}
        {refused !== 0 && <span data-testid="refused" data-refusal={refusal}> The server refused {count(refused)} {refused === 1 ? "cut" : "cuts"}{reason}.</span>}
      </p>
      {tool.copy !== "none" && <CorrectionsLine {...tool.corrections} />}
    </>
  );
}

const MJ = 1000;

/** What news of the clay has done to the hand. */
function CorrectionsLine({ count: corrections, largest_step_n, injected_j, tank_j }: ToolState["corrections"]): JSX.Element {
  return (
    <p
      class="faint says"
      data-testid="corrections"
      data-count={corrections}
      title="What others cut comes in a delay late. The force follows in bounded steps, as long as the energy that this takes was spent on cutting by this hand before; otherwise at once."
    >
      {corrections === 0
        ? "Nothing had to be corrected under the tool."
        : `Corrected under the tool ${count(corrections)} ${corrections === 1 ? "time" : "times"}: at most ${fixed(largest_step_n, 2)} N in a tick, `
          + `${fixed(MJ * injected_j, 1)} mJ brought into the hand, ${fixed(MJ * tank_j, 0)} mJ allowed.`}
    </p>
  );
}
