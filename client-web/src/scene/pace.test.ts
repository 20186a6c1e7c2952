import { describe, expect, it } from "vitest";
import { DISPLAY, Pace, PROCESSOR } from "./pace";

describe("the pace", () => {
  it("stays fine while frames keep up", () => {
    const pace = new Pace(1, 0.4, DISPLAY);
    run(pace, 0, 600, () => 16.7);
    expect(pace.scale).toBe(1);
  });

  it("draws coarser where frames are slow, as far as it must, and settles", () => {
    const pace = new Pace(1, 0.4, DISPLAY);
    // A machine whose frames take as long as their pixels.
    const end_ms = run(pace, 0, 600, () => 40 * pace.scale ** 2);
    const settled = pace.scale;
    expect(40 * settled ** 2).toBeLessThan(22);
    expect(settled).toBeGreaterThan(0.55);
    let changes = 0;
    run(pace, end_ms, 3000, () => 40 * pace.scale ** 2, () => { changes += 1; });
    // Now and then it tries to be finer again, and is put off for longer each time.
    expect(changes).toBeLessThan(14);
  });

  it("never goes below its coarsest, even at a frame a second", () => {
    const pace = new Pace(1, 0.4, DISPLAY);
    run(pace, 0, 60, () => 1000);
    expect(pace.scale).toBe(0.4);
  });

  it("leaves a processor that draws half of its time, at twelve frames a second", () => {
    const pace = new Pace(0.7, 0.4, PROCESSOR);
    for (let n = 0; n < 600; n += 1) pace.take(90 * pace.scale ** 2);
    expect(90 * pace.scale ** 2).toBeLessThan(1000 / 12 / 2 + 4);
    expect(pace.scale).toBeGreaterThan(0.55);
  });

  it("takes a scene at rest for no slow frame", () => {
    const pace = new Pace(1, 0.4, DISPLAY);
    for (let n = 0; n < 100; n += 1) pace.add(n * 5000);
    expect(pace.scale).toBe(1);
  });
});

/** Draws frames that take `frame_ms`; returns when the last one ended. */
function run(pace: Pace, from_ms: number, frames: number, frame_ms: () => number, onChange: () => void = () => undefined): number {
  let now_ms = from_ms;
  for (let n = 0; n < frames; n += 1) {
    now_ms += frame_ms();
    if (pace.add(now_ms)) onChange();
  }
  return now_ms;
}
