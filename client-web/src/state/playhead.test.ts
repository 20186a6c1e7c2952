import { describe, expect, it } from "vitest";
import { Playhead } from "./playhead";

describe("the moment on show", () => {
  it("runs evenly while batches come, and stays close behind the newest sample", () => {
    const playhead = new Playhead();
    let before_s = 0;
    for (let frame = 0; frame < 1200; frame += 1) {
      const now_ms = (frame * 1000) / 60;
      const newest_s = 7 + Math.floor(now_ms / 40) * 0.04;
      const time_s = playhead.at(now_ms, newest_s);
      if (120 < frame) {
        expect(Math.abs(time_s - before_s - 1 / 60)).toBeLessThan(0.1 / 60);
        expect(newest_s - time_s).toBeLessThan(0.08);
      }
      expect(time_s).toBeLessThanOrEqual(newest_s);
      before_s = time_s;
    }
  });

  it("stops with the stream, and goes on from where that goes on", () => {
    const playhead = new Playhead();
    for (let frame = 0; frame < 300; frame += 1) playhead.at(frame * 16, 5);
    expect(playhead.at(300 * 16, 5)).toBeLessThanOrEqual(5);
    expect(playhead.at(301 * 16, 5)).toBeGreaterThan(4.9);
    expect(playhead.at(302 * 16, 60)).toBeGreaterThan(59.9);
    expect(playhead.at(303 * 16, 0.2)).toBeLessThanOrEqual(0.2);
  });

  it("says the same to everyone who asks at the same time", () => {
    const playhead = new Playhead();
    playhead.at(0, 3);
    const time_s = playhead.at(16, 3.04);
    expect(playhead.at(16, 3.04)).toBe(time_s);
  });
});
