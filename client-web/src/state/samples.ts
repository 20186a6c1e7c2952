// Telemetry as it is kept: in blocks of memory that are taken once and used again, with the extremes of every stretch
// beside them, so that five minutes are looked through as fast as ten seconds.

import { Channel, CHANNELS } from "../protocol/telemetry";

/** What is plotted: the channels of telemetry, and sums of them that cannot be told from their extremes. */
export const Kept = {
  ...Channel,
  /** The force that the hand feels less the clay's own, x, y, z. */
  felt_less_clay_n: CHANNELS,
  energy_both_j: CHANNELS + 3,
} as const;
export const KEPT = CHANNELS + 4;

/** Samples of a chunk: four seconds at 250 Hz. */
const CHUNK = 1024;
/** Samples of a stretch whose extremes are kept. */
const STRETCH = 64;
const STRETCHES = CHUNK / STRETCH;

class Chunk {
  readonly time_s = new Float64Array(CHUNK);
  /** Channel after channel: a plot reads one of them in a row. */
  readonly values = new Float32Array(KEPT * CHUNK);
  readonly least = new Float32Array(KEPT * STRETCHES);
  readonly greatest = new Float32Array(KEPT * STRETCHES);
  /** 1 where a stretch has its least value before its greatest. */
  readonly leastFirst = new Uint8Array(KEPT * STRETCHES);
}

/** What a chunk takes. */
export const CHUNK_BYTES = CHUNK * (8 + 4 * KEPT) + STRETCHES * KEPT * 9;
/**
 * For all tools of a session together: five minutes at 250 Hz, as the server sends them, of its eight tools take
 * 85 MB.
 */
const MOST_BYTES = 96e6;

/** The memory of the samples of all tools, and its bound: where it is reached, the oldest samples of all go. */
export class Memory {
  readonly #mostChunks: number;
  readonly #users = new Set<Samples>();
  #spare: Chunk[] = [];
  #chunks = 0;

  constructor(most_bytes = MOST_BYTES) {
    this.#mostChunks = Math.max(Math.floor(most_bytes / CHUNK_BYTES), 2);
  }

  get bytes(): number {
    return this.#chunks * CHUNK_BYTES;
  }

  join(user: Samples): void {
    this.#users.add(user);
  }

  leave(user: Samples): void {
    this.#users.delete(user);
  }

  take(): Chunk {
    const spare = this.#spare.pop();
    if (spare !== undefined) return spare;
    if (this.#mostChunks <= this.#chunks) {
      const oldest = this.#oldestUser();
      if (oldest !== undefined) return oldest.giveUpOldest();
    }
    this.#chunks += 1;
    return new Chunk();
  }

  giveBack(chunks: readonly Chunk[]): void {
    this.#spare.push(...chunks);
  }

  /** Whose oldest sample is the oldest, of those that can do without it. */
  #oldestUser(): Samples | undefined {
    let oldest: Samples | undefined;
    for (const user of this.#users) {
      if (user.chunks < 2) continue;
      if (oldest === undefined || user.oldest_s < oldest.oldest_s) oldest = user;
    }
    return oldest;
  }
}

/** Points as a plot draws them: `count` times, and as many values per curve; not a number where there is a gap. */
export class Points {
  readonly time_s: Float64Array;
  readonly curves: readonly Float64Array[];
  count = 0;
  least = Number.POSITIVE_INFINITY;
  greatest = Number.NEGATIVE_INFINITY;

  constructor(capacity: number, curves: number) {
    this.time_s = new Float64Array(capacity);
    this.curves = Array.from({ length: curves }, () => new Float64Array(capacity));
  }
}

/** The samples of one tool, oldest first. A sample is known by its number, counted since the last clearing. */
export class Samples {
  readonly #memory: Memory;
  readonly #kept_s: number;
  #chunks: Chunk[] = [];
  /** Number of the first kept sample, a multiple of a chunk's. */
  #first = 0;
  #end = 0;
  /** What the last look for extremes found: kept here, so that drawing takes no memory. */
  #least = 0;
  #greatest = 0;
  #leastFirst = true;

  constructor(memory: Memory, kept_s: number) {
    this.#memory = memory;
    this.#kept_s = kept_s;
    memory.join(this);
  }

  /** Number of the oldest sample. */
  get first(): number {
    return this.#first;
  }

  /** One more than the number of the newest. */
  get end(): number {
    return this.#end;
  }

  get chunks(): number {
    return this.#chunks.length;
  }

  get oldest_s(): number {
    return this.#end === this.#first ? 0 : this.#chunks[0].time_s[0];
  }

  /** Appends a sample, which is to be later than the last; `values` holds its channels from `at` on. */
  push(time_s: number, values: Float32Array, at: number): void {
    const slot = this.#end % CHUNK;
    if (slot === 0) this.#grow(time_s);
    const chunk = this.#chunks[this.#chunks.length - 1];
    chunk.time_s[slot] = time_s;
    for (let c = 0; c < CHANNELS; c += 1) keep(chunk, c, slot, values[at + c]);
    for (let axis = 0; axis < 3; axis += 1) {
      keep(chunk, Kept.felt_less_clay_n + axis, slot, values[at + Channel.felt_force_n + axis] - values[at + Channel.tool_force_n + axis]);
    }
    keep(chunk, Kept.energy_both_j, slot, values[at + Channel.energy_handle_j] + values[at + Channel.energy_tool_j]);
    this.#end += 1;
  }

  timeOf(n: number): number {
    return this.#chunks[this.#chunkOf(n)].time_s[n % CHUNK];
  }

  valueOf(channel: number, n: number): number {
    return this.#chunks[this.#chunkOf(n)].values[channel * CHUNK + (n % CHUNK)];
  }

  /** The first kept sample at or after `time_s`. */
  firstAfter(time_s: number): number {
    let [low, high] = [this.#first, this.#end];
    while (low < high) {
      const middle = Math.floor((low + high) / 2);
      if (this.timeOf(middle) < time_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /**
   * The least and the greatest value of a channel in each of the columns, two points each, in the order in which they
   * happened, times `factor` and on top of `offset`: however narrow the plot, it loses no peak.
   */
  envelope(channel: number, factor: number, offset: number, columns: Columns, into: Float64Array): void {
    into.fill(Number.NaN, 0, 2 * columns.count);
    const { width_s, first } = columns;
    const last = this.firstAfter((first + columns.count) * width_s);
    let n = this.firstAfter(first * width_s);
    while (n < last) {
      const column = Math.floor(this.timeOf(n) / width_s);
      const end = this.#endOfColumn(column, width_s, last);
      this.#extremes(channel, n, end);
      n = end;
      const at = 2 * (column - first);
      if (at < 0 || this.#greatest < this.#least) continue;
      into[at] = offset + factor * (this.#leastFirst ? this.#least : this.#greatest);
      into[at + 1] = offset + factor * (this.#leastFirst ? this.#greatest : this.#least);
    }
  }

  /** The first sample after a column. Its border is the one that division gives, to the last bit. */
  #endOfColumn(column: number, width_s: number, last: number): number {
    let end = Math.min(this.firstAfter((column + 1) * width_s), last);
    while (end < last && Math.floor(this.timeOf(end) / width_s) <= column) end += 1;
    while (column < Math.floor(this.timeOf(end - 1) / width_s)) end -= 1;
    return end;
  }

  clear(): void {
    this.#memory.giveBack(this.#chunks);
    this.#chunks = [];
    this.#first = 0;
    this.#end = 0;
  }

  /** Takes the memory back for good. */
  dispose(): void {
    this.clear();
    this.#memory.leave(this);
  }

  giveUpOldest(): Chunk {
    const [oldest, ...others] = this.#chunks;
    this.#chunks = others;
    this.#first += CHUNK;
    return oldest;
  }

  /** Of a channel, from a sample to before another; the least is above the greatest where there is no number. */
  #extremes(channel: number, from: number, end: number): void {
    this.#least = Number.POSITIVE_INFINITY;
    this.#greatest = Number.NEGATIVE_INFINITY;
    let n = from;
    while (n < end) {
      const chunk = this.#chunks[this.#chunkOf(n)];
      const slot = n % CHUNK;
      if (slot % STRETCH === 0 && n + STRETCH <= end) {
        const at = channel * STRETCHES + slot / STRETCH;
        this.#widen(chunk.least[at], chunk.greatest[at], chunk.leastFirst[at] === 1);
        n += STRETCH;
      } else {
        const value = chunk.values[channel * CHUNK + slot];
        this.#widen(value, value, true);
        n += 1;
      }
    }
  }

  #widen(least: number, greatest: number, leastFirst: boolean): void {
    const [lower, higher] = [least < this.#least, this.#greatest < greatest];
    if (lower) this.#least = least;
    if (higher) this.#greatest = greatest;
    if (lower && higher) this.#leastFirst = leastFirst;
    else if (lower) this.#leastFirst = false;
    else if (higher) this.#leastFirst = true;
  }

  #chunkOf(n: number): number {
    return Math.floor((n - this.#first) / CHUNK);
  }

  #grow(time_s: number): void {
    const next = this.#chunks.at(1);
    const isOld = next !== undefined && next.time_s[0] < time_s - this.#kept_s;
    const chunk = isOld ? this.giveUpOldest() : this.#memory.take();
    this.#chunks.push(chunk);
  }
}

/** Writes a value, and widens the extremes of its stretch. */
function keep(chunk: Chunk, channel: number, slot: number, value: number): void {
  chunk.values[channel * CHUNK + slot] = value;
  const at = channel * STRETCHES + Math.floor(slot / STRETCH);
  if (slot % STRETCH === 0) {
    chunk.least[at] = Number.POSITIVE_INFINITY;
    chunk.greatest[at] = Number.NEGATIVE_INFINITY;
  }
  const kept = chunk.values[channel * CHUNK + slot];
  const [lower, higher] = [kept < chunk.least[at], chunk.greatest[at] < kept];
  if (lower) chunk.least[at] = kept;
  if (higher) chunk.greatest[at] = kept;
  if (lower && higher) chunk.leastFirst[at] = 1;
  else if (lower) chunk.leastFirst[at] = 0;
  else if (higher) chunk.leastFirst[at] = 1;
}

/**
 * Columns of equal width, counted from the start of time: a sample's column does not depend on where the plot begins,
 * so the drawn shape moves with the data and does not flicker. The last one holds the end of the window.
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
