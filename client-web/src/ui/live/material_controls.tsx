// What the clay resists with.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import type { Material } from "../../protocol/session";
import { MATERIALS } from "../materials";
import { NumberField } from "../number_field";
import { decades } from "../slider_scale";
import { live } from "../store";

export function MaterialControls(): JSX.Element {
  const now = useComputed(() => live.session.value?.material).value;
  const isNow = (preset: Material): boolean =>
    now?.viscosity_pa_s_per_m === preset.viscosity_pa_s_per_m &&
    now.yield_stress_pa === preset.yield_stress_pa &&
    now.stiffness_pa === preset.stiffness_pa;
  return (
    <section class="group" aria-label="Material">
      <h2>Clay</h2>
      <div class="chips" role="group" aria-label="Material presets">
        {Object.values(MATERIALS).map((preset) => (
          <button
            key={preset.name}
            type="button"
            title={preset.says}
            aria-pressed={isNow(preset)}
            onClick={() => live.edits.wish({
              "/material/viscosity_pa_s_per_m": preset.viscosity_pa_s_per_m,
              "/material/yield_stress_pa": preset.yield_stress_pa,
              "/material/stiffness_pa": preset.stiffness_pa,
            })}
          >
            {preset.name}
          </button>
        ))}
      </div>
      <NumberField pointer="/material/viscosity_pa_s_per_m" label="viscosity" unit="kPa·s/m" factor={1e-3} scale={decades(1e3, 1e7)} />
      <NumberField pointer="/material/yield_stress_pa" label="yield" unit="kPa" factor={1e-3} scale={decades(10, 1e6)} />
      <NumberField pointer="/material/stiffness_pa" label="stiffness" unit="MPa" factor={1e-6} scale={decades(1e4, 1e9)} />
    </section>
  );
}
