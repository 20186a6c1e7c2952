// Makes a session: one of a few kinds, and a name.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { freeName } from "../../protocol/name";
import { sessions } from "../store";
import { NameField } from "./name_field";
import { bodyOf, PRESETS } from "./presets";
import { fault } from "./words";

/** `onMade` hears the name of a session that was made. */
export function NewSession({ onMade }: { readonly onMade: (id: string) => void }): JSX.Element {
  const chosen = useSignal(PRESETS[0]);
  /** Nothing while the preset's own name is good enough. */
  const typed = useSignal<string | undefined>(undefined);
  const refusal = useSignal<string | undefined>(undefined);
  const isBusy = useSignal(false);
  const { entries } = sessions;
  const name = typed.value ?? freeName(chosen.value.name, entries.map(({ id }) => id));
  const wrong = fault(name, entries);
  const create = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (wrong !== undefined || isBusy.value) return;
    isBusy.value = true;
    refusal.value = await sessions.create(bodyOf(chosen.value, name));
    isBusy.value = false;
    if (refusal.value !== undefined) return;
    typed.value = undefined;
    onMade(name);
  };
  return (
    <form class="panel new" aria-label="New session" data-testid="new-session" onSubmit={(event) => void create(event)}>
      <h2>New session</h2>
      <fieldset class="presets">
        <legend class="hidden">What it starts as</legend>
        {PRESETS.map((preset) => (
          <label key={preset.name}>
            <input
              type="radio"
              name="preset"
              value={preset.name}
              checked={preset === chosen.value}
              onChange={() => { chosen.value = preset; }}
              data-testid={`preset-${preset.name}`}
            />
            <span>
              <strong>{preset.title}</strong>
              <small>{preset.says}</small>
            </span>
          </label>
        ))}
      </fieldset>
      <NameField id="new-name" value={name} fault={wrong} onType={(text) => { typed.value = text; }} />
      <button type="submit" class="primary" disabled={wrong !== undefined || isBusy.value} data-testid="create">Create session</button>
      {refusal.value !== undefined && <p class="refusal" role="alert">Not created: {refusal.value}.</p>}
    </form>
  );
}
