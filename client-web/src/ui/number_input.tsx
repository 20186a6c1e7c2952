// A number in a table: typed, taken on Enter or on leaving, and refused with a reason.

import type { JSX } from "preact";
import { type Check, useEntry } from "./number/entry";
import type { Unit } from "./number/typed";

interface NumberInputProps extends Unit {
  readonly name: string;
  readonly label: string;
  /** Value in SI units. */
  readonly value: number;
  readonly onWish: (value: number) => void;
  readonly check: Check;
}

export function NumberInput({ name, label, value, unit, factor, onWish, check }: NumberInputProps): JSX.Element {
  const entry = useEntry({ value, ofField: { unit, factor }, check, onWish });
  const reason = entry.reason.value;
  return (
    <>
      <input
        type="text"
        class="cell"
        inputMode="decimal"
        autocomplete="off"
        spellcheck={false}
        data-testid={name}
        aria-label={label}
        aria-invalid={reason !== undefined}
        aria-describedby={reason === undefined ? undefined : `${name}-refusal`}
        title={label}
        value={entry.text}
        {...entry.handlers}
      />
      {reason !== undefined && <p class="refusal" id={`${name}-refusal`} role="alert">{reason}</p>}
    </>
  );
}
