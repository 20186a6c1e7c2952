// What the link conditioner does to packets, each way or both ways alike.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { NumberPointer } from "../../state/edits";
import { NumberField, numberAt } from "../number_field";
import { decades, power, type SliderScale } from "../slider_scale";
import { live } from "../store";

type Quantity = "delay_s" | "jitter_s" | "loss";

interface Row {
  readonly quantity: Quantity;
  readonly label: string;
  readonly unit: string;
  readonly factor: number;
  readonly scale: SliderScale;
}

const ROWS: readonly Row[] = [
  { quantity: "delay_s", label: "delay", unit: "ms", factor: 1000, scale: power(0.5, 2) },
  { quantity: "jitter_s", label: "jitter", unit: "ms", factor: 1000, scale: decades(1e-4, 0.1) },
  { quantity: "loss", label: "loss", unit: "%", factor: 100, scale: power(0.5, 2) },
];

/** One way, seconds and shares. */
const PRESETS = [
  { name: "none", says: "nothing added", delay_s: 0, jitter_s: 0, loss: 0 },
  { name: "city", says: "5 ms each way", delay_s: 0.005, jitter_s: 5e-4, loss: 0 },
  { name: "continent", says: "25 ms each way, some jitter", delay_s: 0.025, jitter_s: 0.002, loss: 0.001 },
  { name: "ocean", says: "80 ms each way, jitter and loss", delay_s: 0.08, jitter_s: 0.008, loss: 0.01 },
  { name: "satellite", says: "270 ms each way", delay_s: 0.27, jitter_s: 0.01, loss: 0.005 },
] as const;

const up = (quantity: Quantity): NumberPointer => `/network/up/${quantity}`;
const down = (quantity: Quantity): NumberPointer => `/network/down/${quantity}`;

export function NetworkControls(): JSX.Element {
  const serverIsSymmetric = useComputed(() =>
    ROWS.every(({ quantity }) => numberAt(live.session.value, up(quantity)) === numberAt(live.session.value, down(quantity))));
  /** Somebody's choice; nothing while the server's own state says it best. */
  const wanted = useSignal<boolean | undefined>(undefined);
  const symmetric = wanted.value ?? serverIsSymmetric.value;
  const choose = (both: boolean): void => {
    wanted.value = both;
    if (!both || serverIsSymmetric.value) return;
    const session = live.session.peek();
    live.edits.wish(Object.fromEntries(ROWS.map(({ quantity }) => [down(quantity), numberAt(session, up(quantity)) ?? 0])));
  };
  return (
    <section class="group network" aria-label="Network">
      <header>
        <h2>Network</h2>
        <label class="check">
          <input type="checkbox" checked={symmetric} onChange={({ currentTarget }) => choose(currentTarget.checked)} data-testid="symmetric" />
          <span>same both ways</span>
        </label>
      </header>
      <div class="chips" role="group" aria-label="Network presets">
        {PRESETS.map(({ name, says, ...values }) => (
          <button key={name} type="button" title={says} onClick={() => live.edits.wish(Object.fromEntries(
            ROWS.flatMap(({ quantity }) => [[up(quantity), values[quantity]], [down(quantity), values[quantity]]])))}>
            {name}
          </button>
        ))}
      </div>
      {!symmetric && <h3>handle to server</h3>}
      {ROWS.map(({ quantity, ...row }) => (
        <NumberField key={quantity} {...row} pointer={up(quantity)} along={symmetric ? [down(quantity)] : []} />
      ))}
      {!symmetric && <h3>server to handle</h3>}
      {!symmetric && ROWS.map(({ quantity, ...row }) => <NumberField key={quantity} {...row} pointer={down(quantity)} />)}
      <h3 title="A frame whose force or velocity differs from the one sent last by less than this share is left out. A hand can just tell 7 %.">
        frames left out below a change of
      </h3>
      <NumberField pointer="/deadband" label="deadband" unit="%" factor={100} scale={power(0.5, 2)} />
    </section>
  );
}
