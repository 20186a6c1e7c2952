// One setting of the session: the server's value, a wish while it is under way, a refusal beside it.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import type { Session } from "../protocol/session";
import type { NumberPointer } from "../state/edits";
import { type Refusal, refusalOf } from "./number/refusal";
import { live } from "./store";
import { type Quantity, ValueField } from "./value_field";

export interface NumberFieldProps extends Quantity {
  readonly pointer: NumberPointer;
  /** Settings that take the same value. */
  readonly along?: readonly NumberPointer[];
}

export function NumberField({ pointer, along = [], ...quantity }: NumberFieldProps): JSX.Element {
  const edit = live.edits.of(pointer).value;
  const server = useComputed(() => numberAt(live.session.value, pointer));
  const wish = (si: number): void => {
    const changes: Partial<Record<NumberPointer, number>> = {};
    for (const each of [pointer, ...along]) changes[each] = si;
    live.edits.wish(changes);
  };
  return (
    <ValueField
      {...quantity}
      name={pointer}
      value={edit.name === "wished" && typeof edit.value === "number" ? edit.value : server.value}
      onWish={wish}
      state={edit.name}
      refusal={refusalAmong([pointer, ...along])}
    />
  );
}

function refusalAmong(pointers: readonly NumberPointer[]): Refusal | undefined {
  for (const pointer of pointers) {
    const edit = live.edits.of(pointer).value;
    if (edit.name === "refused") return refusalOf(edit.detail);
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
    case "/deadband": return session.deadband;
  }
}
