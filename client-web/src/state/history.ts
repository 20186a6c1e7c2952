// The last seconds of one tool's telemetry, and the few points of them that a plot can show.

import { CHANNELS, type TelemetryBatch } from "../protocol/telemetry";

/** At 1 kHz a little more than 16 s: the plots show ten. */
const CAPACITY = 1 << 14;
/** A step back in time of more than this is another run of the server, s. */
const BACKWARDS_S = 0.5;

/** A share of a channel: what is plotted is a sum of such. */
export interface Term {
  readonly channel: number;
  readonly factor: number;
}

/** Two points per column, in the order in which they happened; `null` where nothing was received. */
export type Envelope = (number | null)[];

export class History {
  readonly #time_s = new Float64Array(CAPACITY);
  /** Channel after channel: a plot reads one of them in a row. */
  readonly #values = new Float32Array(CHANNELS * CAPACITY);
  /** Samples ever appended since the last clearing. */
  #count = 0;
  dropped = 0;

  get isEmpty(): boolean {
    return this.#count === 0;
  }

  /** Time of the newest sample, s; 0 before the first. */
  get newest_s(): number {
    return this.isEmpty ? 0 : this.#time_s[(this.#count - 1) % CAPACITY];
  }

  append(batch: TelemetryBatch): void {
    if (batch.first_time_s < this.newest_s - BACKWARDS_S) this.clear();
    this.dropped += batch.dropped;
    const samples = batch.values.length / CHANNELS;
    for (let n = 0; n < samples; n += 1) {
      const time_s = batch.first_time_s + (n * batch.period_us) / 1e6;
      if (!this.isEmpty && time_s <= this.newest_s) continue;
      const slot = this.#count % CAPACITY;
      this.#time_s[slot] = time_s;
      for (let c = 0; c < CHANNELS; c += 1) this.#values[c * CAPACITY + slot] = batch.values[n * CHANNELS + c];
      this.#count += 1;
    }
  }

  clear(): void {
    this.#count = 0;
    this.dropped = 0;
  }

  /** The newest value of a channel; 0 before the first. */
  latest(channel: number): number {
    return this.isEmpty ? 0 : this.#values[channel * CAPACITY + ((this.#count - 1) % CAPACITY)];
  }

  /** The newest x, y, z of a vector that starts at `channel`. */
  latestVector(channel: number): [number, number, number] {
    return [this.latest(channel), this.latest(channel + 1), this.latest(channel + 2)];
  }

  /** A vector as it was at `time_s`, on the straight line between the samples around. */
  vectorAt(channel: number, time_s: number): [number, number, number] {
    const after = this.#firstAfter(time_s);
    const kept = Math.max(this.#count - CAPACITY, 0);
    if (after <= kept || this.#count <= after) return this.latestVector(channel);
    const [a, b] = [(after - 1) % CAPACITY, after % CAPACITY];
    const t = (time_s - this.#time_s[a]) / (this.#time_s[b] - this.#time_s[a]);
    const along = (axis: number): number => {
      const [from, to] = [a, b].map((slot) => this.#values[(channel + axis) * CAPACITY + slot]);
      return from + t * (to - from);
    };
    return [along(0), along(1), along(2)];
  }

  /** Greatest length of a vector over the last `span_s`. */
  greatest(channel: number, span_s: number): number {
    let greatest = 0;
    for (let i = this.#firstAfter(this.newest_s - span_s); i < this.#count; i += 1) {
      const slot = i % CAPACITY;
      const [x, y, z] = [0, 1, 2].map((axis) => this.#values[(channel + axis) * CAPACITY + slot]);
      greatest = Math.max(greatest, Math.hypot(x, y, z));
    }
    return greatest;
  }

  /**
   * Where a vector was over the `span_s` before `until_s`, oldest first, `step_s` apart: x, y, z one after the other.
   * Taken at whole multiples of the step, so that the line does not crawl as time passes.
   */
  path(channel: number, until_s: number, span_s: number, step_s: number): number[] {
    const points: number[] = [];
    let last = Number.NEGATIVE_INFINITY;
    for (let i = this.#firstAfter(until_s - span_s); i < this.#count; i += 1) {
      const slot = i % CAPACITY;
      if (until_s < this.#time_s[slot]) break;
      const step = Math.floor(this.#time_s[slot] / step_s);
      if (step === last) continue;
      last = step;
      for (let axis = 0; axis < 3; axis += 1) points.push(this.#values[(channel + axis) * CAPACITY + slot]);
    }
    if (0 < points.length) points.push(...this.vectorAt(channel, until_s));
    return points;
  }

  /**
   * The least and the greatest value of a sum of channels in each of the columns, so that no peak is lost however
   * narrow the plot. Columns begin at whole multiples of their width: they move with the data, and the drawn shape does
   * not flicker.
   */
  envelope(terms: readonly Term[], columns: Columns): Envelope {
    const points: Envelope = new Array<number | null>(2 * columns.count).fill(null);
    let column = -1;
    let [least, greatest, leastFirst, any] = [0, 0, true, false];
    const flush = (): void => {
      if (!any) return;
      points[2 * column] = leastFirst ? least : greatest;
      points[2 * column + 1] = leastFirst ? greatest : least;
    };
    for (let i = this.#firstAfter((columns.first - 1) * columns.width_s); i < this.#count; i += 1) {
      const slot = i % CAPACITY;
      const at = Math.floor(this.#time_s[slot] / columns.width_s) - columns.first;
      if (at < 0) continue;
      if (columns.count <= at) break;
      let value = 0;
      for (const { channel, factor } of terms) value += factor * this.#values[channel * CAPACITY + slot];
      if (at !== column) {
        flush();
        column = at;
        [least, greatest, any] = [value, value, true];
      } else if (value < least) {
        least = value;
        leastFirst = false;
      } else if (greatest < value) {
        greatest = value;
        leastFirst = true;
      }
    }
    flush();
    return points;
  }

  /** The first kept sample at or after `time_s`, counted since the last clearing. */
  #firstAfter(time_s: number): number {
    let [low, high] = [Math.max(this.#count - CAPACITY, 0), this.#count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.#time_s[middle % CAPACITY] < time_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

/**
 * Columns of equal width, counted from the start of time: a sample's column does not depend on where the plot begins.
 * The last one holds the newest sample.
 */
export interface Columns {
  readonly first: number;
  readonly width_s: number;
  readonly count: number;
}

export function columnsUntil(until_s: number, span_s: number, wanted: number): Columns {
  const width_s = span_s / wanted;
  // One column more than asked for: the first is only partly within the span.
  return { first: Math.floor(until_s / width_s) - wanted, width_s, count: wanted + 1 };
}

/** The times of an envelope's points, s before `until_s`. */
export function timesOf(columns: Columns, until_s: number): number[] {
  const times: number[] = [];
  for (let n = 0; n < 2 * columns.count; n += 1) {
    times.push((columns.first + n / 2 + 0.25) * columns.width_s - until_s);
  }
  return times;
}
