// Clays that one may want, by name.

import type { Material } from "../protocol/session";

export interface NamedMaterial extends Material {
  readonly name: string;
  readonly says: string;
}

/** The viscous one is that of the cutting experiment: 20, 40 and 60 N·s/m at 1, 2 and 3 cm of a blade 1 cm wide. */
export const MATERIALS = {
  viscous: { name: "viscous", says: "the cutting experiment's clay: force grows with speed alone", viscosity_pa_s_per_m: 2e5, yield_stress_pa: 0, stiffness_pa: 0 },
  slip: { name: "slip", says: "wet and soft", viscosity_pa_s_per_m: 5e4, yield_stress_pa: 500, stiffness_pa: 2e5 },
  plastic: { name: "plastic", says: "holds its shape, gives way to a firm push", viscosity_pa_s_per_m: 1.5e5, yield_stress_pa: 4000, stiffness_pa: 1e6 },
  firm: { name: "firm", says: "stiff, hard to cut", viscosity_pa_s_per_m: 4e5, yield_stress_pa: 12000, stiffness_pa: 5e6 },
} as const satisfies Record<string, NamedMaterial>;

/** As a request or an answer has it. */
export function materialOf({ viscosity_pa_s_per_m, yield_stress_pa, stiffness_pa }: Material): Material {
  return { viscosity_pa_s_per_m, yield_stress_pa, stiffness_pa };
}
