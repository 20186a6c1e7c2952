// Gains, clay and delay.

import type { JSX } from "preact";
import { Choice } from "../choice";
import { within } from "../number/entry";
import type { Named } from "../number/refusal";
import { decades, power } from "../slider_scale";
import { type Quantity, ValueField } from "../value_field";
import { type NumberSetting, PRESETS, round_trip_s, set, settings } from "./model";

interface Row extends Quantity {
  readonly setting: NumberSetting;
  /** Bounds in SI units. */
  readonly least: number;
  readonly greatest: number;
}

const HANDLE: readonly Row[] = [
  { setting: "mass_kg", label: "mass M", unit: "kg", factor: 1, scale: decades(0.01, 10), least: 1e-3, greatest: 1e3 },
  { setting: "damping_n_s_per_m", label: "damp. B", unit: "N·s/m", factor: 1, scale: decades(0.1, 100), least: 0, greatest: 1e5 },
  { setting: "stiffness_n_per_m", label: "spring K", unit: "N/m", factor: 1, scale: decades(0.1, 1000), least: 0, greatest: 1e6 },
];
const RATIOS: readonly Row[] = [
  { setting: "position_ratio", label: "A_h1", unit: "tool/hand", factor: 1, scale: decades(0.1, 10), least: 1e-3, greatest: 1e3, title: "tool position over handle position" },
  { setting: "force_ratio", label: "−A_h2", unit: "clay/hand", factor: 1, scale: decades(0.1, 10), least: 1e-3, greatest: 1e3, title: "clay force over hand force, without its sign" },
];
const CLAY: readonly Row[] = [
  { setting: "clay_damping_n_s_per_m", label: "damping", unit: "N·s/m", factor: 1, scale: decades(1, 1000), least: 0, greatest: 1e6 },
  { setting: "clay_stiffness_n_per_m", label: "stiffness", unit: "N/m", factor: 1, scale: decades(1, 10_000), least: 0, greatest: 1e7 },
];

/** What the server may find at fault, as people see it here. */
export const FIELDS: Readonly<Record<string, Named>> = {
  "/c_h1": { label: "handle", unit: "", factor: 1 },
  ...Object.fromEntries([...RATIOS, ...CLAY].map(({ setting, label, unit, factor }) => [`/${setting}`, { label, unit, factor }])),
};

export function StabilityControls(): JSX.Element {
  return (
    <section class="panel controls" aria-label="Settings">
      <div class="group">
        <div class="chips" role="group" aria-label="Examples">
          {PRESETS.map((preset) => (
            <button
              key={preset.name}
              type="button"
              title={preset.says}
              aria-pressed={preset.settings === settings.value && preset.round_trip_s === round_trip_s.value}
              onClick={() => {
                settings.value = preset.settings;
                round_trip_s.value = preset.round_trip_s;
              }}
            >
              {preset.name}
            </button>
          ))}
        </div>
      </div>
      <div class="group">
        <h2>Network</h2>
        <ValueField
          name="round_trip_s"
          label="round trip"
          unit="ms"
          title="delay from the handle to the tool and back"
          factor={1000}
          scale={power(0.5, 2)}
          value={round_trip_s.value}
          check={within(0, 10)}
          onWish={(value) => { round_trip_s.value = value; }}
        />
      </div>
      <div class="group">
        <header>
          <h2>Handle, C_h1 = 1 / (M s² + B s + K)</h2>
          <Choice
            name="axis"
            label="Servo of axis"
            options={[{ value: "x", text: "x", title: "servo of (35)" }, { value: "y", text: "y", title: "servo of (36)" }]}
            value={settings.value.axis}
            onChoose={(axis) => { settings.value = { ...settings.value, axis }; }}
          />
        </header>
        {HANDLE.map(field)}
      </div>
      <div class="group"><h2>Ratios</h2>{RATIOS.map(field)}</div>
      <div class="group"><h2>Clay, T_t = B_t s + K_t</h2>{CLAY.map(field)}</div>
      <div class="group formulas">
        <h2>Symbols</h2>
        <p>P = G_h C_h1, H = P T_h, E = ρ P T_t, ρ = A_h1/|A_h2|</p>
        <p>L = E + H: stable without delay when L keeps clear of −1, on the right side of it.</p>
        <p><i class="dash position_force" aria-hidden="true" /> 1 + H + E e<sup>−sd</sup> = 0</p>
        <p><i class="dash force_exchange" aria-hidden="true" /> (1 + E)(1 + H) − H E e<sup>−sd</sup> = 0</p>
      </div>
    </section>
  );
}

function field({ setting, least, greatest, ...quantity }: Row): JSX.Element {
  return (
    <ValueField
      key={setting}
      {...quantity}
      name={setting}
      value={settings.value[setting]}
      check={within(least, greatest)}
      onWish={(value) => set(setting, value)}
    />
  );
}
