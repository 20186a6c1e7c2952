// One number to set: a slider and a field, what stands there, and why it is not taken.

import type { JSX } from "preact";
import { type Check, useEntry } from "./number/entry";
import { type Refusal, refusalIn } from "./number/refusal";
import type { Unit } from "./number/typed";
import type { SliderScale } from "./slider_scale";

/** How a quantity is shown and set. */
export interface Quantity extends Unit {
  readonly label: string;
  readonly scale: SliderScale;
  readonly title?: string;
}

export interface ValueFieldProps extends Quantity {
  /** Unique on the page; also what tests call it. */
  readonly name: string;
  /** SI; nothing while it is not known. */
  readonly value: number | undefined;
  /** Takes the new value, in SI units. */
  readonly onWish: (value: number) => void;
  /** Asked for, not yet confirmed. */
  readonly state?: "settled" | "wished" | "refused";
  readonly refusal?: Refusal | undefined;
  /** Why a value is not even asked for; nothing when it may be. */
  readonly check?: Check;
}

const SLIDER_STEPS = 1000;

export function ValueField({
  name, value, onWish, label, unit, factor, scale, title, state = "settled", refusal, check,
}: ValueFieldProps): JSX.Element {
  const entry = useEntry({ value, ofField: { unit, factor }, check, onWish });
  const reason = entry.reason.value ?? (refusal === undefined ? undefined : refusalIn(entry.unit.value, refusal));
  const id = `field-${name.replaceAll("/", "-")}`;

  return (
    <div class="field" data-edit={state} data-testid={name} title={title}>
      <label for={id}>{label}</label>
      <input
        type="range"
        min={0}
        max={SLIDER_STEPS}
        value={value === undefined ? 0 : scale.toShare(value) * SLIDER_STEPS}
        aria-label={`${label}, slider`}
        aria-valuetext={`${entry.text} ${unit}`}
        onInput={({ currentTarget }) => entry.wish(scale.toValue(Number(currentTarget.value) / SLIDER_STEPS))}
      />
      <span class="number">
        <input
          id={id}
          type="text"
          inputMode="decimal"
          autocomplete="off"
          spellcheck={false}
          value={entry.text}
          aria-invalid={reason !== undefined}
          aria-describedby={reason === undefined ? undefined : `${id}-refusal`}
          {...entry.handlers}
        />
        <span class="unit">{unit}</span>
      </span>
      {reason !== undefined && <p class="refusal" id={`${id}-refusal`} role="alert">{reason}</p>}
    </div>
  );
}
