import { describe, expect, it } from "vitest";
import { CHANNELS } from "../protocol/telemetry";
import { CHUNK_BYTES, Memory, Samples } from "./samples";

const SAMPLE = new Float32Array(CHANNELS);

function fill(samples: Samples, from_s: number, to_s: number, period_s: number): void {
  for (let n = Math.round(from_s / period_s); n * period_s < to_s; n += 1) samples.push(n * period_s, SAMPLE, 0);
}

describe("the memory of telemetry", () => {
  it("holds five minutes of eight tools as the server sends them, within its bound", () => {
    const memory = new Memory();
    const tools = Array.from({ length: 8 }, () => new Samples(memory, 300));
    for (let s = 0; s < 330; s += 1) for (const tool of tools) fill(tool, s, s + 1, 0.004);
    for (const tool of tools) expect(330 - tool.oldest_s).toBeGreaterThanOrEqual(300);
    expect(memory.bytes).toBeLessThanOrEqual(96e6);
    // Blocks are used again: another five minutes take nothing.
    const { bytes } = memory;
    for (let s = 330; s < 660; s += 1) for (const tool of tools) fill(tool, s, s + 1, 0.004);
    expect(memory.bytes).toBe(bytes);
  });

  it("is as large as the buffers in it", () => {
    // Eight bytes of time, and four of each of 27 channels and four sums; per 64 samples the extremes and their order.
    expect(CHUNK_BYTES).toBe(1024 * (8 + 31 * 4) + (1024 / 64) * 31 * (4 + 4 + 1));
  });

  it("lets the oldest samples of all tools go where the bound is reached, and never a tool's newest", () => {
    const memory = new Memory(10 * CHUNK_BYTES);
    const [quiet, busy] = [new Samples(memory, 300), new Samples(memory, 300)];
    fill(quiet, 0, 4, 0.004);
    for (let s = 0; s < 100; s += 1) fill(busy, s, s + 1, 0.004);
    expect(memory.bytes).toBe(10 * CHUNK_BYTES);
    expect([quiet.first, quiet.end]).toEqual([0, 1000]);
    expect(busy.end - busy.first).toBeGreaterThan(8 * 1024);
    expect(busy.end).toBe(25_000);
  });

  it("has again what a tool gave back", () => {
    const memory = new Memory();
    for (let n = 0; n < 5; n += 1) {
      const tool = new Samples(memory, 300);
      fill(tool, 0, 60, 0.004);
      tool.dispose();
    }
    expect(memory.bytes).toBe(Math.ceil(15_000 / 1024) * CHUNK_BYTES);
  });
});
