// A number in a table: typed, taken on Enter or on leaving, and refused with a reason.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { parseNumber, plain } from "./format";

interface NumberInputProps {
  readonly name: string;
  readonly label: string;
  /** SI. */
  readonly value: number;
  readonly factor: number;
  readonly onWish: (value: number) => void;
  /** Why a value is not taken; nothing when it is. */
  readonly check: (value: number) => string | undefined;
}

export function NumberInput({ name, label, value, factor, onWish, check }: NumberInputProps): JSX.Element {
  const typed = useSignal<string | undefined>(undefined);
  const wrong = useSignal<string | undefined>(undefined);
  const shown = plain(value * factor);
  const commit = (): void => {
    const text = typed.value;
    typed.value = undefined;
    if (text === undefined) return;
    const number = parseNumber(text);
    wrong.value = number === undefined ? `“${text}” is not a number` : text === shown ? undefined : check(number / factor);
    if (number !== undefined && wrong.value === undefined && text !== shown) onWish(Number((number / factor).toPrecision(12)));
  };
  return (
    <input
      type="text"
      class="cell"
      inputMode="decimal"
      autocomplete="off"
      spellcheck={false}
      data-testid={name}
      aria-label={label}
      aria-invalid={wrong.value !== undefined}
      title={wrong.value ?? label}
      value={typed.value ?? shown}
      onInput={({ currentTarget }) => {
        typed.value = currentTarget.value;
      }}
      onBlur={commit}
      onKeyDown={({ key }) => {
        if (key === "Enter") commit();
        if (key === "Escape") typed.value = undefined;
      }}
    />
  );
}
