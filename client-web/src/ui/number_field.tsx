// One setting: a slider and a number, the server's value in both, a wish while it is under way, a refusal beside it.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { Session } from "../protocol/session";
import type { NumberPointer } from "../state/edits";
import { parseNumber, plain } from "./format";
import type { SliderScale } from "./slider_scale";
import { live } from "./store";

export interface NumberFieldProps {
  readonly pointer: NumberPointer;
  /** Settings that take the same value. */
  readonly along?: readonly NumberPointer[];
  readonly label: string;
  readonly unit: string;
  /** Shown value per SI value: 1000 for milliseconds. */
  readonly factor: number;
  readonly scale: SliderScale;
}

const SLIDER_STEPS = 1000;

export function NumberField({ pointer, along = [], label, unit, factor, scale }: NumberFieldProps): JSX.Element {
  const edit = live.edits.of(pointer).value;
  const server = useComputed(() => numberAt(live.session.value, pointer));
  /** What is being typed; nothing while nobody types. */
  const typed = useSignal<string | undefined>(undefined);
  const wrong = useSignal<string | undefined>(undefined);
  const value = edit.name === "wished" && typeof edit.value === "number" ? edit.value : server.value;
  const shown = value === undefined ? "" : plain(value * factor);
  const refusal = wrong.value ?? refusalAmong([pointer, ...along]);
  const id = `field${pointer.replaceAll("/", "-")}`;

  const wish = (si: number): void => {
    wrong.value = undefined;
    const changes: Partial<Record<NumberPointer, number>> = {};
    for (const each of [pointer, ...along]) changes[each] = si;
    live.edits.wish(changes);
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
    <div class="field" data-edit={edit.name} data-testid={pointer}>
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
          aria-invalid={refusal !== undefined}
          aria-describedby={refusal === undefined ? undefined : `${id}-refusal`}
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
      {refusal !== undefined && <p class="refusal" id={`${id}-refusal`} role="alert">{refusal}</p>}
    </div>
  );
}

function refusalAmong(pointers: readonly NumberPointer[]): string | undefined {
  for (const pointer of pointers) {
    const edit = live.edits.of(pointer).value;
    if (edit.name === "refused") return edit.detail;
  }
  return undefined;
}

/** The server's own value of a setting, SI. */
export function numberAt(session: Session | undefined, pointer: NumberPointer): number | undefined {
  if (session === undefined) return undefined;
  const { material, network: { up, down } } = session;
  switch (pointer) {
    case "/material/viscosity_pa_s_per_m": return material.viscosity_pa_s_per_m;
    case "/material/yield_stress_pa": return material.yield_stress_pa;
    case "/material/stiffness_pa": return material.stiffness_pa;
    case "/network/up/delay_s": return up.delay_s;
    case "/network/up/jitter_s": return up.jitter_s;
    case "/network/up/loss": return up.loss;
    case "/network/down/delay_s": return down.delay_s;
    case "/network/down/jitter_s": return down.jitter_s;
    case "/network/down/loss": return down.loss;
  }
}
