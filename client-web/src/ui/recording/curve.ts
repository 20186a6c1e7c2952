// The points of a curve from the extremes of its columns.

import type { Term } from "../../state/history";
import { Points } from "../../state/samples";
import type { Plot } from "../../film/port";

/** Columns without a value between two that have one are lines up to this, s: a recording may show tools seldom. */
const BRIDGED_S = 0.3;
/** And as long as so many columns. */
const BRIDGED_COLUMNS = 3;

/** `envelopes` by term: least and greatest of each column, the first above the second where there is none. */
export function pointsOf(terms: readonly Term[], { from_s, to_s, columns }: Plot, envelopes: readonly Float32Array[]): Points {
  const points = new Points(2 * columns, terms.length);
  const width_s = (to_s - from_s) / columns;
  const bridged = Math.max(BRIDGED_COLUMNS, Math.ceil(BRIDGED_S / width_s));
  let last = Number.NEGATIVE_INFINITY;
  let count = 0;
  for (let column = 0; column < columns; column += 1) {
    const isEmpty = envelopes.every((envelope) => !(envelope[2 * column] <= envelope[2 * column + 1]));
    if (isEmpty) {
      if (column - last !== bridged + 1) continue;
      // One point without a value breaks the line.
      points.time_s[count] = from_s + (column + 0.5) * width_s;
      for (const curve of points.curves) curve[count] = Number.NaN;
      count += 1;
      continue;
    }
    last = column;
    for (const [half, at] of [[0, 0.25], [1, 0.75]] as const) {
      points.time_s[count] = from_s + (column + at) * width_s;
      for (const [n, { factor, offset }] of terms.entries()) {
        const value = envelopes[n][2 * column + half];
        const drawn = Number.isFinite(value) ? offset + factor * value : Number.NaN;
        points.curves[n][count] = drawn;
        if (drawn < points.least) points.least = drawn;
        if (points.greatest < drawn) points.greatest = drawn;
      }
      count += 1;
    }
  }
  points.count = count;
  return points;
}

/** What a plot shows: all of a recording, or a stretch of it with the moment in its middle, as far as there is one. */
export function stretchAbout(at_s: number, span_s: number, lasts_s: number): { readonly from_s: number; readonly to_s: number } {
  if (lasts_s <= span_s) return { from_s: 0, to_s: Math.max(lasts_s, 1e-3) };
  const from_s = Math.min(Math.max(at_s - span_s / 2, 0), lasts_s - span_s);
  return { from_s, to_s: from_s + span_s };
}
