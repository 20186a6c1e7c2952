// The vertical range of a live plot: it grows at once, shrinks only after a while, and ends on round numbers, so that
// the eye can hold on to the scale.

/** The range is kept while the data fills at least this share of it. */
const LEAST_FILL = 0.45;
/** Updates for which the data has to stay small before the range shrinks: about two seconds of display. */
const PATIENCE = 90;
/** Shares of a power of ten at which ticks may stand. */
const STEPS = [1, 2, 5, 10];

export class AutoRange {
  #range: [number, number];
  #small = 0;
  readonly #least: number;

  /** `least` is the smallest height worth showing: below it there is only noise. */
  constructor(least: number) {
    this.#least = least;
    this.#range = [-least / 2, least / 2];
  }

  /** The range for data between `low` and `high`. */
  update(low: number, high: number): [number, number] {
    if (!Number.isFinite(low) || !Number.isFinite(high)) return this.#range;
    const wanted = rounded(low, high, this.#least);
    const fits = this.#range[0] <= low && high <= this.#range[1];
    const fill = (wanted[1] - wanted[0]) / (this.#range[1] - this.#range[0]);
    this.#small = fits && fill < LEAST_FILL ? this.#small + 1 : 0;
    if (!fits || PATIENCE <= this.#small) {
      this.#range = wanted;
      this.#small = 0;
    }
    return this.#range;
  }

  /** The same for a plot that stands still: what is gone from it need not be remembered. */
  settle(low: number, high: number): [number, number] {
    if (Number.isFinite(low) && Number.isFinite(high)) this.#range = rounded(low, high, this.#least);
    this.#small = 0;
    return this.#range;
  }
}

/** A little more than `low` … `high`, out to round numbers. */
function rounded(low: number, high: number, least: number): [number, number] {
  const height = Math.max(high - low, least);
  const middle = (low + high) / 2;
  const margin = 0.08 * height;
  const step = roundStep(height / 4);
  return [
    Math.floor((Math.min(low, middle - height / 2) - margin) / step) * step,
    Math.ceil((Math.max(high, middle + height / 2) + margin) / step) * step,
  ];
}

/** The least of 1, 2, 5, 10, … that is not below `size`. */
export function roundStep(size: number): number {
  const power = 10 ** Math.floor(Math.log10(size));
  const share = STEPS.find((step) => size <= step * power * 1.0001) ?? 10;
  return share * power;
}
