import { describe, expect, it } from "vitest";
import { Channel, CHANNELS, type TelemetryBatch } from "../protocol/telemetry";
import { History, KEPT_S, pointsFor, type Stretch, type Term } from "./history";
import { Kept, Points } from "./samples";

const FORCE: Term = { channel: Channel.tool_force_n, factor: 1, offset: 0 };

describe("history", () => {
  it("gives back what came last", () => {
    const history = new History();
    history.append(batch(0, 20, (t) => t));
    history.append(batch(0.02, 20, (t) => -t));
    expect(history.newest_s).toBeCloseTo(0.039);
    expect(history.latest(Channel.tool_force_n)).toBeCloseTo(-0.039);
    expect(history.latestVector(Channel.tool_force_n)).toEqual([history.latest(Channel.tool_force_n), 0, 0]);
  });

  it("loses no spike: every column has its least and its greatest sample, in their order, as counting them one by one finds", () => {
    const random = chance(7);
    let [dense, sparse] = [0, 0];
    for (let round = 0; round < 60; round += 1) {
      const history = new History();
      const samples = irregular(history, random);
      const span_s = 10 ** (3 * random() - 1.5);
      const to_s = samples[Math.floor(random() * samples.length)].time_s + random() - 0.5;
      const columns = 3 + Math.floor(200 * random());
      const term = { channel: Channel.tool_force_n, factor: random() < 0.5 ? -3 : 0.5, offset: 7 };
      const points = plotted(history, [term], { from_s: to_s - span_s, to_s }, columns);
      const shown = samples.filter(({ time_s }) => to_s - span_s <= time_s && time_s < to_s);
      const expected = (force_n: number): number => 7 + term.factor * Math.fround(force_n);
      if (4 * columns < shown.length) {
        dense += 1;
        const width_s = span_s / columns;
        const first = Math.floor(to_s / width_s) - columns;
        for (let column = 0; column < columns; column += 1) {
          const own = samples.filter(({ time_s }) => Math.floor(time_s / width_s) === first + column).map(({ force_n }) => force_n);
          const [one, other] = [points[2 * column].value, points[2 * column + 1].value];
          if (own.length === 0) {
            expect([one, other]).toEqual([Number.NaN, Number.NaN]);
            continue;
          }
          const [least, greatest] = [Math.min(...own), Math.max(...own)];
          const leastIsFirst = own.indexOf(least) <= own.indexOf(greatest);
          expect([one, other]).toEqual((leastIsFirst ? [least, greatest] : [greatest, least]).map(expected));
        }
      } else if (shown.length + 2 <= 4 * columns) {
        // Few samples: each of them is there.
        sparse += 1;
        const values = new Set(points.map(({ value }) => value));
        for (const { force_n } of shown) expect(values.has(expected(force_n))).toBe(true);
      }
    }
    expect(Math.min(dense, sparse)).toBeGreaterThan(5);
  });

  it("draws as many columns as pixels where samples are dense, and single samples where they are not", () => {
    const history = new History();
    for (let n = 0; n < 600; n += 1) history.append(batch(n * 0.1, 100, (t) => (Math.abs(t - 33.3335) < 6e-4 ? 100 : Math.sin(t))));
    const dense = plotted(history, [FORCE], { from_s: 0, to_s: 60 }, 200);
    expect(dense.length).toBe(402);
    expect(Math.max(...dense.map(({ value }) => value).filter((value) => !Number.isNaN(value)))).toBe(100);
    const sparse = plotted(history, [FORCE], { from_s: 30, to_s: 30.2 }, 200);
    expect(sparse.map(({ time_s }) => Math.round(1000 * time_s))).toEqual(Array.from({ length: 202 }, (_, n) => 29_999 + n));
  });

  it("keeps a column's shape as time passes: the same samples, the same two points in the same order", () => {
    const history = new History();
    for (let n = 0; n < 100; n += 1) history.append(batch(n * 0.02, 20, (t) => Math.sin(40 * t)));
    const before = byColumn(history);
    history.append(batch(2, 137, (t) => Math.sin(40 * t)));
    const after = byColumn(history);
    // All but the column that was still being filled and those that have scrolled out.
    const kept = [...before.keys()].filter((column) => after.has(column)).slice(1, -1);
    expect(kept.length).toBeGreaterThan(20);
    for (const column of kept) expect(after.get(column)).toEqual(before.get(column));
  });

  it("shows a gap where samples were lost, near and from afar", () => {
    const history = new History();
    history.append(batch(0, 1000, () => 1));
    history.append({ ...batch(3, 1000, () => 2), dropped: 2000 });
    for (const columns of [40, 1000]) {
      const points = plotted(history, [FORCE], { from_s: 0, to_s: 4 }, columns);
      const [before, after] = [points.findLast(({ time_s }) => time_s < 0.97), points.find(({ time_s }) => 3.05 < time_s)];
      expect([before?.value, after?.value]).toEqual([1, 2]);
      const between = points.filter(({ time_s }) => 1.1 < time_s && time_s < 2.9);
      expect(between.length).toBeGreaterThan(0);
      for (const { value } of between) expect(value).toBeNaN();
    }
    expect(history.dropped).toBe(2000);
    expect(history.valueNear(FORCE, 2)).toBeUndefined();
  });

  it("has the difference and the sum that are plotted, sample by sample and in their extremes", () => {
    const history = new History();
    const told = batch(0, 4000, () => 0);
    for (let n = 0; n < 4000; n += 1) {
      told.values[n * CHANNELS + Channel.felt_force_n + 1] = n;
      told.values[n * CHANNELS + Channel.tool_force_n + 1] = n - (n === 1234 ? 50 : 1);
      told.values[n * CHANNELS + Channel.energy_handle_j] = 0.5 * n;
      told.values[n * CHANNELS + Channel.energy_tool_j] = -0.25 * n;
    }
    history.append(told);
    const apart = plotted(history, [{ channel: Kept.felt_less_clay_n + 1, factor: 1, offset: 0 }], { from_s: 0, to_s: 4 }, 20);
    expect(Math.max(...apart.map(({ value }) => value).filter((value) => !Number.isNaN(value)))).toBe(50);
    expect(history.valueNear({ channel: Kept.energy_both_j, factor: 1000, offset: 0 }, 0.1)).toBe(25_000);
  });

  it("tells the value under the cursor: that of the nearest sample, as it was received", () => {
    const history = new History();
    history.append({ ...batch(10, 100, (t) => Math.round(1000 * t)), period_us: 4000 });
    expect(history.sampleNear(10.0093)).toBeCloseTo(10.008, 9);
    expect(history.valueNear({ channel: Channel.tool_force_n, factor: 2, offset: 1 }, 10.0093)).toBe(2 * 10_002 + 1);
    expect(history.sampleNear(10.0101)).toBeCloseTo(10.012, 9);
    expect(history.sampleNear(9.99)).toBeCloseTo(10, 9);
    expect(history.sampleNear(9.9)).toBeUndefined();
    expect(history.sampleNear(10.5)).toBeUndefined();
  });

  it("keeps five minutes at every rate, all of it, and little more", () => {
    for (const period_us of [4000, 1000]) {
      const history = new History();
      const count = 500;
      const step_s = (count * period_us) / 1e6;
      for (let n = 0; n * step_s < 400; n += 1) history.append({ ...batch(n * step_s, count, () => n), period_us });
      expect(history.newest_s - history.oldest_s).toBeGreaterThanOrEqual(KEPT_S);
      expect(history.newest_s - history.oldest_s).toBeLessThan(KEPT_S + 10);
      let rows = 0;
      history.each([FORCE], { from_s: history.newest_s - KEPT_S, to_s: history.newest_s }, () => { rows += 1; });
      expect(Math.abs(rows - KEPT_S / (period_us / 1e6))).toBeLessThanOrEqual(1);
    }
  });

  it("starts over when the server's clock does, and passes over what it has already", () => {
    const history = new History();
    history.append(batch(100, 20, () => 7));
    history.append(batch(100, 20, () => 9));
    expect(history.latest(Channel.tool_force_n)).toBe(7);
    history.append(batch(0, 20, () => 3));
    expect(history.latest(Channel.tool_force_n)).toBe(3);
    expect(history.newest_s).toBeCloseTo(0.019);
  });

  it("knows what was between two samples, and the newest where there is no later one", () => {
    const history = new History();
    history.append({ ...batch(0, 10, (t) => 1000 * t), period_us: 4000 });
    expect(history.vectorAt(Channel.tool_force_n, 0.01)[0]).toBeCloseTo(2.5, 5);
    expect(history.vectorAt(Channel.tool_force_n, 0.012)[0]).toBeCloseTo(3, 5);
    expect(history.vectorAt(Channel.tool_force_n, 5)[0]).toBe(history.latest(Channel.tool_force_n));
    const path = history.path(Channel.tool_force_n, 0.021, 1, 0.004).filter((_, i) => i % 3 === 0);
    expect(path.at(-1)).toBeCloseTo(5.25, 5);
  });

  it("finds the greatest force and the path of the last seconds only", () => {
    const history = new History();
    for (let n = 0; n < 400; n += 1) history.append(batch(n * 0.02, 20, (t) => (t < 1 ? 30 : 2)));
    expect(history.greatest(Channel.tool_force_n, 10)).toBe(30);
    expect(history.greatest(Channel.tool_force_n, 5)).toBe(2);
    const path = history.path(Channel.tool_force_n, history.newest_s, 2, 0.05);
    expect(path.length / 3).toBeGreaterThanOrEqual(40);
    expect(path.length / 3).toBeLessThanOrEqual(42);
  });
});

/** Samples at 1 kHz whose tool force along x is a function of time. */
function batch(first_time_s: number, count: number, force_n: (time_s: number) => number): TelemetryBatch {
  const values = new Float32Array(count * CHANNELS);
  for (let n = 0; n < count; n += 1) values[n * CHANNELS + Channel.tool_force_n] = force_n(first_time_s + n * 1e-3);
  return { sequence: 0, tool: 1, period_us: 1000, dropped: 0, first_time_s, values };
}

interface Sample {
  readonly time_s: number;
  readonly force_n: number;
}

/** Batches of any length at 1 kHz with gaps between them, spikes among them; what was appended. */
function irregular(history: History, random: () => number): Sample[] {
  const samples: Sample[] = [];
  let first_time_s = 100 * random();
  while (samples.length < 12_000) {
    const count = 1 + Math.floor(700 * random());
    const told = batch(first_time_s, count, () => (random() < 0.01 ? 1000 : 1) * (random() - 0.5));
    history.append(told);
    for (let n = 0; n < count; n += 1) samples.push({ time_s: first_time_s + (n * told.period_us) / 1e6, force_n: told.values[n * CHANNELS + Channel.tool_force_n] });
    first_time_s += count * 1e-3 + (random() < 0.3 ? random() : 0);
  }
  return samples;
}

/** Numbers from 0 to 1 that are the same on every run. */
function chance(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1_664_525) + 1_013_904_223) >>> 0;
    return state / 2 ** 32;
  };
}

/** What a plot of the first term draws. */
function plotted(history: History, terms: readonly Term[], stretch: Stretch, columns: number): { time_s: number; value: number }[] {
  const points = new Points(pointsFor(columns), terms.length);
  history.plot(terms, stretch, columns, 0, points);
  return Array.from({ length: points.count }, (_, n) => ({ time_s: points.time_s[n], value: points.curves[0][n] }));
}

/** The points of each column, by the column's number. */
function byColumn(history: History): Map<number, number[]> {
  const to_s = history.newest_s;
  const points = plotted(history, [FORCE], { from_s: to_s - 1.5, to_s }, 60);
  const first = Math.floor(to_s / (1.5 / 60)) - 60;
  return new Map(Array.from({ length: 61 }, (_, n) => [first + n, points.slice(2 * n, 2 * n + 2).map(({ value }) => value)]));
}
