// The name of a session that is to be made.

import type { JSX } from "preact";

interface NameFieldProps {
  readonly id: string;
  readonly value: string;
  /** Why it cannot be the name. */
  readonly fault: string | undefined;
  readonly onType: (name: string) => void;
}

export function NameField({ id, value, fault, onType }: NameFieldProps): JSX.Element {
  return (
    <div class="name">
      <label for={id}>Name</label>
      <input
        type="text"
        id={id}
        autocomplete="off"
        autocapitalize="none"
        spellcheck={false}
        value={value}
        onInput={({ currentTarget }) => onType(currentTarget.value)}
        aria-invalid={fault !== undefined}
        aria-describedby={`${id}-fault`}
        data-testid={id}
      />
      <p class="refusal" id={`${id}-fault`} aria-live="polite">{fault}</p>
    </div>
  );
}
