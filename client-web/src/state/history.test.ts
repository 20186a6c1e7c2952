import { describe, expect, it } from "vitest";
import { Channel, CHANNELS, type TelemetryBatch } from "../protocol/telemetry";
import { columnsUntil, History, timesOf } from "./history";

describe("history", () => {
  it("gives back what came last", () => {
    const history = new History();
    history.append(batch(0, 20, (t) => t));
    history.append(batch(0.02, 20, (t) => -t));
    expect(history.newest_s).toBeCloseTo(0.039);
    expect(history.latest(Channel.tool_force_n)).toBeCloseTo(-0.039);
    expect(history.latestVector(Channel.tool_force_n)).toEqual([history.latest(Channel.tool_force_n), 0, 0]);
  });

  it("loses no peak, however few columns there are", () => {
    const history = new History();
    for (let n = 0; n < 500; n += 1) {
      history.append(batch(n * 0.02, 20, (t) => (Math.abs(t - 3.3335) < 6e-4 ? 100 : Math.abs(t - 7.7775) < 6e-4 ? -50 : Math.sin(t))));
    }
    for (const wanted of [40, 173, 600]) {
      const points = history.envelope([{ channel: Channel.tool_force_n, factor: 1 }], columnsUntil(history.newest_s, 10, wanted)).filter((p) => p !== null);
      expect(Math.max(...points)).toBe(100);
      expect(Math.min(...points)).toBe(-50);
    }
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

  it("shows a gap where samples were lost", () => {
    const history = new History();
    history.append(batch(0, 1000, () => 1));
    history.append({ ...batch(3, 1000, () => 2), dropped: 2000 });
    const columns = columnsUntil(history.newest_s, 4, 40);
    const points = history.envelope([{ channel: Channel.tool_force_n, factor: 1 }], columns);
    const times = timesOf(columns, history.newest_s);
    for (const [n, time] of times.entries()) {
      const at_s = time + history.newest_s;
      if (1.2 < at_s && at_s < 2.9) expect(points[n]).toBeNull();
      if (3.1 < at_s && at_s < 3.9) expect(points[n]).toBe(2);
    }
    expect(history.dropped).toBe(2000);
  });

  it("forgets the oldest samples and keeps every younger one", () => {
    const history = new History();
    for (let n = 0; n < 1500; n += 1) history.append(batch(n * 0.02, 20, (t) => t));
    const points = history.envelope([{ channel: Channel.tool_force_n, factor: 1 }], columnsUntil(history.newest_s, 10, 100)).filter((p) => p !== null);
    expect(Math.min(...points)).toBeCloseTo(20, 0);
    expect(Math.max(...points)).toBeCloseTo(29.999, 3);
    expect(points.length).toBeGreaterThan(198);
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

/** The points of each column, by the column's number. */
function byColumn(history: History): Map<number, (number | null)[]> {
  const columns = columnsUntil(history.newest_s, 1.5, 60);
  const points = history.envelope([{ channel: Channel.tool_force_n, factor: 1 }], columns);
  return new Map(Array.from({ length: columns.count }, (_, n) => [columns.first + n, points.slice(2 * n, 2 * n + 2)]));
}
