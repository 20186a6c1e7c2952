// How long a newton is drawn: the greatest force of the last seconds gets an arrow that is easily seen and stays in
// view.

const LONGEST_MM = 45;
/** Millimetres per newton that read well beside the picture. */
const SCALES = [50, 20, 10, 5, 2, 1, 0.5, 0.2, 0.1];

/** Millimetres per newton, for forces of these sizes, N. */
export function arrowScale(...forces_n: readonly number[]): number {
  const greatest_n = Math.max(...forces_n);
  return SCALES.find((scale) => scale * greatest_n <= LONGEST_MM) ?? SCALES[SCALES.length - 1];
}
