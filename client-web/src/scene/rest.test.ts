import { describe, expect, it } from "vitest";
import { Rest } from "./rest";

describe("the rest of a processor that draws", () => {
  it("allows ten frames a second where a frame takes half of that time, and draws no more than that", () => {
    const rest = new Rest();
    let [now_ms, frames] = [0, 0];
    while (now_ms < 10_000) {
      rest.begin();
      expect(rest.isOver(now_ms + 1e6)).toBe(false);
      now_ms += 50;
      rest.end(now_ms, 50);
      frames += 1;
      while (!rest.isOver(now_ms)) now_ms += 1;
    }
    expect(frames).toBeGreaterThanOrEqual(100);
    expect(50 * frames).toBeLessThan(0.6 * 10_000);
  });

  it("leaves a machine that has other things to do most of its time", () => {
    const rest = new Rest();
    rest.begin();
    rest.end(100, 90);
    expect([rest.isOver(100 + 170), rest.isOver(100 + 190)]).toEqual([false, true]);
  });

  it("is broken off where somebody waits, and over when a frame is given up", () => {
    const rest = new Rest();
    rest.end(100, 90);
    rest.breakOff();
    expect(rest.isOver(100)).toBe(true);
    rest.begin();
    rest.end(200);
    expect(rest.isOver(200)).toBe(true);
  });
});
