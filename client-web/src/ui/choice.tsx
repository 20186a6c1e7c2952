// One of a few: buttons of which one is down.

import type { JSX } from "preact";

interface ChoiceProps<T extends string> {
  /** Unique on the page. */
  readonly name: string;
  readonly label: string;
  readonly options: readonly { readonly value: T; readonly text: string; readonly title?: string }[];
  readonly value: T;
  readonly onChoose: (value: T) => void;
}

export function Choice<T extends string>({ name, label, options, value, onChoose }: ChoiceProps<T>): JSX.Element {
  return (
    <div class="segmented" role="radiogroup" aria-label={label} data-testid={name}>
      {options.map((option) => (
        <label key={option.value} title={option.title}>
          <input type="radio" name={name} value={option.value} checked={option.value === value} onChange={() => onChoose(option.value)} />
          <span>{option.text}</span>
        </label>
      ))}
    </div>
  );
}
