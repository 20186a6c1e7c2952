// Clays that one may want, by name: the presets of GET /materials. A test of the protocol's crate compares the numbers.

import type { Material } from "../protocol/session";

export interface NamedMaterial extends Material {
  readonly name: string;
  readonly says: string;
}

/** Where the numbers come from stands in docs/materials.md. */
export const MATERIALS = {
  paper_clay: { name: "paper's clay", says: "the cutting experiment's clay: force grows with speed alone", viscosity_pa_s_per_m: 200000, yield_stress_pa: 0, stiffness_pa: 0 },
  soft_oil_clay: { name: "soft oil clay", says: "oil clay warmed for modelling: gives way to a light push", viscosity_pa_s_per_m: 200000, yield_stress_pa: 30000, stiffness_pa: 30000 },
  firm_clay: { name: "firm clay", says: "water clay that keeps its shape and gives way to a firm push", viscosity_pa_s_per_m: 400000, yield_stress_pa: 75000, stiffness_pa: 40000 },
  wax: { name: "wax", says: "warm modelling wax: hard to cut, and harder the faster", viscosity_pa_s_per_m: 400000, yield_stress_pa: 120000, stiffness_pa: 40000 },
  foam: { name: "foam", says: "brittle foam that crushes, at a force that hardly grows with speed", viscosity_pa_s_per_m: 100000, yield_stress_pa: 30000, stiffness_pa: 20000 },
} as const satisfies Record<string, NamedMaterial>;

/** As a request or an answer has it. */
export function materialOf({ viscosity_pa_s_per_m, yield_stress_pa, stiffness_pa }: Material): Material {
  return { viscosity_pa_s_per_m, yield_stress_pa, stiffness_pa };
}
