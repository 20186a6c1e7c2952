// The last minutes of one tool's telemetry, and the few points of them that a plot can show.

import { CHANNELS, type TelemetryBatch } from "../protocol/telemetry";
import { columnsUntil, Memory, type Points, Samples } from "./samples";

/** As far back as plots go, s. */
export const KEPT_S = 300;
/** A step back in time of more than this is another run of the server, s. */
const BACKWARDS_S = 0.5;
/** Up to so many samples per column each is drawn as it is; beyond, a column's least and greatest. */
const FEW = 4;
/** Samples farther apart than this many of their periods have others between them that were lost. */
const GAP = 3;

/** What a plot draws of a channel: `offset + factor * value`. */
export interface Term {
  readonly channel: number;
  readonly factor: number;
  readonly offset: number;
}

/** The time that a plot shows. */
export interface Stretch {
  readonly from_s: number;
  readonly to_s: number;
}

/** Points of a plot of so many columns, at the most: two where a gap begins. */
export function pointsFor(columns: number): number {
  return 2 * FEW * columns + 8;
}

export class History {
  readonly #samples: Samples;
  #period_s = 0;
  dropped = 0;

  constructor(memory = new Memory()) {
    this.#samples = new Samples(memory, KEPT_S);
  }

  get isEmpty(): boolean {
    return this.#samples.end === 0;
  }

  /** Time of the newest sample, s; 0 before the first. */
  get newest_s(): number {
    return this.isEmpty ? 0 : this.#samples.timeOf(this.#samples.end - 1);
  }

  /** Time of the oldest sample that is kept, s; 0 before the first. */
  get oldest_s(): number {
    return this.#samples.oldest_s;
  }

  append(batch: TelemetryBatch): void {
    if (batch.first_time_s < this.newest_s - BACKWARDS_S) this.clear();
    this.dropped += batch.dropped;
    this.#period_s = batch.period_us / 1e6;
    const samples = batch.values.length / CHANNELS;
    for (let n = 0; n < samples; n += 1) {
      const time_s = batch.first_time_s + (n * batch.period_us) / 1e6;
      if (this.isEmpty || this.newest_s < time_s) this.#samples.push(time_s, batch.values, n * CHANNELS);
    }
  }

  clear(): void {
    this.#samples.clear();
    this.dropped = 0;
  }

  /** Gives its memory back: nothing is to be appended any more. */
  dispose(): void {
    this.#samples.dispose();
  }

  /** The newest value of a channel; 0 before the first. */
  latest(channel: number): number {
    return this.isEmpty ? 0 : this.#samples.valueOf(channel, this.#samples.end - 1);
  }

  /** The newest x, y, z of a vector that starts at `channel`. */
  latestVector(channel: number): [number, number, number] {
    return [this.latest(channel), this.latest(channel + 1), this.latest(channel + 2)];
  }

  /** A vector as it was at `time_s`, on the straight line between the samples around. */
  vectorAt(channel: number, time_s: number): [number, number, number] {
    const samples = this.#samples;
    const after = samples.firstAfter(time_s);
    if (after <= samples.first || samples.end <= after) return this.latestVector(channel);
    const from_s = samples.timeOf(after - 1);
    const t = (time_s - from_s) / (samples.timeOf(after) - from_s);
    const along = (axis: number): number => {
      const from = samples.valueOf(channel + axis, after - 1);
      return from + t * (samples.valueOf(channel + axis, after) - from);
    };
    return [along(0), along(1), along(2)];
  }

  /** Greatest length of a vector over the last `span_s`. */
  greatest(channel: number, span_s: number): number {
    const samples = this.#samples;
    let greatest = 0;
    for (let n = samples.firstAfter(this.newest_s - span_s); n < samples.end; n += 1) {
      const [x, y, z] = [samples.valueOf(channel, n), samples.valueOf(channel + 1, n), samples.valueOf(channel + 2, n)];
      greatest = Math.max(greatest, x * x + y * y + z * z);
    }
    return Math.sqrt(greatest);
  }

  /**
   * Where a vector was over the `span_s` before `until_s`, oldest first, `step_s` apart: x, y, z one after the other.
   * Taken at whole multiples of the step, so that the line does not crawl as time passes.
   */
  path(channel: number, until_s: number, span_s: number, step_s: number): number[] {
    const samples = this.#samples;
    const points: number[] = [];
    let last = Number.NEGATIVE_INFINITY;
    for (let n = samples.firstAfter(until_s - span_s); n < samples.end; n += 1) {
      const time_s = samples.timeOf(n);
      if (until_s < time_s) break;
      const step = Math.floor(time_s / step_s);
      if (step === last) continue;
      last = step;
      for (let axis = 0; axis < 3; axis += 1) points.push(samples.valueOf(channel + axis, n));
    }
    if (0 < points.length) points.push(...this.vectorAt(channel, until_s));
    return points;
  }

  /**
   * Writes what a plot of `columns` columns draws of a stretch of time: each sample where they are few, else the least
   * and the greatest of every column, so that no peak is lost. Times are counted from `origin_s`.
   */
  plot(terms: readonly Term[], stretch: Stretch, columns: number, origin_s: number, into: Points): void {
    const { from_s, to_s } = stretch;
    const samples = this.#samples;
    // One more on either side: lines go on to the edges of the picture.
    const first = Math.max(samples.firstAfter(from_s) - 1, samples.first);
    const end = Math.min(samples.firstAfter(to_s) + 1, samples.end);
    if (end - first <= FEW * columns) this.#plotSamples(terms, first, end, origin_s, into);
    else this.#plotEnvelopes(terms, stretch, columns, origin_s, into);
    measure(into);
  }

  /** The time of the sample that is nearest to `time_s`; nothing where none is within a gap's length. */
  sampleNear(time_s: number): number | undefined {
    const n = this.#near(time_s);
    return n === undefined ? undefined : this.#samples.timeOf(n);
  }

  /** What a plot has at the sample nearest to `time_s`; nothing where a gap is. */
  valueNear(term: Term, time_s: number): number | undefined {
    const n = this.#near(time_s);
    return n === undefined ? undefined : term.offset + term.factor * this.#samples.valueOf(term.channel, n);
  }

  /**
   * Every sample of a stretch of time, oldest first: `take` gets its time and the terms' values, in a row that is used
   * again for the next.
   */
  each(terms: readonly Term[], { from_s, to_s }: Stretch, take: (time_s: number, row: Float64Array) => void): void {
    const samples = this.#samples;
    const row = new Float64Array(terms.length);
    for (let n = samples.firstAfter(from_s); n < samples.end; n += 1) {
      const time_s = samples.timeOf(n);
      if (to_s < time_s) return;
      for (const [t, { channel, factor, offset }] of terms.entries()) row[t] = offset + factor * samples.valueOf(channel, n);
      take(time_s, row);
    }
  }

  #near(time_s: number): number | undefined {
    const samples = this.#samples;
    const after = samples.firstAfter(time_s);
    let nearest: number | undefined;
    let apart_s = GAP * this.#period_s;
    for (let n = Math.max(after - 1, samples.first); n < Math.min(after + 1, samples.end); n += 1) {
      const distance_s = Math.abs(samples.timeOf(n) - time_s);
      if (apart_s < distance_s) continue;
      apart_s = distance_s;
      nearest = n;
    }
    return nearest;
  }

  #plotSamples(terms: readonly Term[], first: number, end: number, origin_s: number, into: Points): void {
    const samples = this.#samples;
    const gap_s = GAP * this.#period_s;
    let count = 0;
    for (let n = first; n < end; n += 1) {
      const time_s = samples.timeOf(n);
      const before_s = n === first ? time_s : samples.timeOf(n - 1);
      if (gap_s < time_s - before_s) {
        into.time_s[count] = (before_s + time_s) / 2 - origin_s;
        for (const curve of into.curves) curve[count] = Number.NaN;
        count += 1;
      }
      into.time_s[count] = time_s - origin_s;
      for (let t = 0; t < terms.length; t += 1) {
        into.curves[t][count] = terms[t].offset + terms[t].factor * samples.valueOf(terms[t].channel, n);
      }
      count += 1;
    }
    into.count = count;
  }

  #plotEnvelopes(terms: readonly Term[], { from_s, to_s }: Stretch, wanted: number, origin_s: number, into: Points): void {
    const columns = columnsUntil(to_s, to_s - from_s, wanted);
    for (let n = 0; n < 2 * columns.count; n += 1) {
      into.time_s[n] = (columns.first + n / 2 + 0.25) * columns.width_s - origin_s;
    }
    for (let t = 0; t < terms.length; t += 1) {
      this.#samples.envelope(terms[t].channel, terms[t].factor, terms[t].offset, columns, into.curves[t]);
    }
    into.count = 2 * columns.count;
  }
}

function measure(points: Points): void {
  points.least = Number.POSITIVE_INFINITY;
  points.greatest = Number.NEGATIVE_INFINITY;
  for (const curve of points.curves) {
    for (let n = 0; n < points.count; n += 1) {
      if (curve[n] < points.least) points.least = curve[n];
      if (points.greatest < curve[n]) points.greatest = curve[n];
    }
  }
}
