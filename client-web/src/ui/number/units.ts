// Units that a person may write behind a number, by what they measure. Within one table every unit leads to every
// other.

/** SI per unit. */
type Units = Readonly<Record<string, number>>;

const TABLES: readonly Units[] = [
  { ns: 1e-9, us: 1e-6, ms: 1e-3, s: 1, sec: 1, min: 60 },
  { nm: 1e-9, um: 1e-6, mm: 1e-3, cm: 1e-2, dm: 0.1, m: 1 },
  { mN: 1e-3, N: 1, kN: 1e3 },
  { g: 1e-3, kg: 1 },
  { "N·s/m": 1, "kN·s/m": 1e3, "N·s/mm": 1e3, "kg/s": 1 },
  { "N/m": 1, "kN/m": 1e3, "N/mm": 1e3, "N/cm": 100 },
  { Pa: 1, kPa: 1e3, MPa: 1e6, GPa: 1e9 },
  { "Pa·s/m": 1, "kPa·s/m": 1e3, "MPa·s/m": 1e6 },
  { "%": 1e-2, "‰": 1e-3, percent: 1e-2 },
  { "°": Math.PI / 180, deg: Math.PI / 180, degrees: Math.PI / 180, rad: 1 },
];

/**
 * What a written unit is, beside the unit of a field: SI per unit, or nothing when it measures something else or
 * nothing at all.
 */
export function perUnit(written: string, ofField: string): number | undefined {
  const table = tableOf(ofField);
  if (table === undefined) return undefined;
  const wanted = bare(written);
  const exact = Object.keys(table).filter((unit) => bare(unit) === wanted);
  // MS is ms; but MPa and mPa are two units, so only what has one meaning is taken.
  const found = 0 < exact.length ? exact : Object.keys(table).filter((unit) => bare(unit).toLowerCase() === wanted.toLowerCase());
  return found.length === 1 ? table[found[0]] : undefined;
}

/** Whether a unit measures something, as opposed to naming a ratio. */
export function isUnit(unit: string): boolean {
  return tableOf(unit) !== undefined;
}

function tableOf(unit: string): Units | undefined {
  return TABLES.find((table) => Object.hasOwn(table, unit));
}

/** A unit without what people write in different ways: spaces, dots and crosses between its parts, one of two mus. */
function bare(unit: string): string {
  return unit.replaceAll(/[µμ]/g, "u").replaceAll(/[\s·⋅∙*×.]/g, "");
}
