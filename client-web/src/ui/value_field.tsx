// One number to set: a slider and a field, what stands there, and why it is not taken.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { parseNumber, plain } from "./format";
import type { SliderScale } from "./slider_scale";

/** How a quantity is shown and set. */
export interface Quantity {
  readonly label: string;
  readonly unit: string;
  /** Shown value per SI value: 1000 for milliseconds. */
  readonly factor: number;
  readonly scale: SliderScale;
  readonly title?: string;
}

export interface ValueFieldProps extends Quantity {
  /** Unique on the page; also what tests call it. */
  readonly name: string;
  /** SI; nothing while it is not known. */
  readonly value: number | undefined;
  /** SI. */
  readonly onWish: (value: number) => void;
  /** Asked for, not yet confirmed. */
  readonly state?: "settled" | "wished" | "refused";
  readonly refusal?: string | undefined;
  /** Why a value is not even asked for; nothing when it may be. */
  readonly check?: (value: number) => string | undefined;
}

const SLIDER_STEPS = 1000;

export function ValueField({
  name, value, onWish, label, unit, factor, scale, title, state = "settled", refusal, check,
}: ValueFieldProps): JSX.Element {
  /** What is being typed; nothing while nobody types. */
  const typed = useSignal<string | undefined>(undefined);
  const wrong = useSignal<string | undefined>(undefined);
  const shown = value === undefined ? "" : plain(value * factor);
  const reason = wrong.value ?? refusal;
  const id = `field-${name.replaceAll("/", "-")}`;

  const wish = (wanted: number): void => {
    wrong.value = check?.(wanted);
    if (wrong.value === undefined) onWish(wanted);
  };
  const commit = (): void => {
    const text = typed.value;
    typed.value = undefined;
    if (text === undefined || text === shown) return;
    const number = parseNumber(text);
    if (number === undefined) wrong.value = `“${text}” is not a number`;
    else wish(number / factor);
  };

  return (
    <div class="field" data-edit={state} data-testid={name} title={title}>
      <label for={id}>{label}</label>
      <input
        type="range"
        min={0}
        max={SLIDER_STEPS}
        value={value === undefined ? 0 : scale.toShare(value) * SLIDER_STEPS}
        aria-label={`${label}, slider`}
        aria-valuetext={`${shown} ${unit}`}
        onInput={({ currentTarget }) => wish(scale.toValue(Number(currentTarget.value) / SLIDER_STEPS))}
      />
      <span class="number">
        <input
          id={id}
          type="text"
          inputMode="decimal"
          autocomplete="off"
          spellcheck={false}
          value={typed.value ?? shown}
          aria-invalid={reason !== undefined}
          aria-describedby={reason === undefined ? undefined : `${id}-refusal`}
          onInput={({ currentTarget }) => {
            typed.value = currentTarget.value;
          }}
          onBlur={commit}
          onKeyDown={({ key }) => {
            if (key === "Enter") commit();
            if (key === "Escape") typed.value = undefined;
          }}
        />
        <span class="unit">{unit}</span>
      </span>
      {reason !== undefined && <p class="refusal" id={`${id}-refusal`} role="alert">{reason}</p>}
    </div>
  );
}
