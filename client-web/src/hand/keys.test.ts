import { describe, expect, it } from "vitest";
import { at, bench, near } from "./fake_loop";
import { headingOf, turned } from "./keys";
import { type PadReading, rumbleOf } from "./stick";

describe("keys", () => {
  const key = { isRepeat: false, shift: false };

  it("move a hand that is held, at a steady speed, as seen from where one looks", () => {
    const { loop, keys, grip } = bench();
    keys.tick(0, [0, 1]);
    keys.press("ArrowRight", key);
    for (let now_ms = 0; now_ms <= 1000; now_ms += 20) keys.tick(now_ms, [0, 1]);
    expect(loop.told).toEqual([]);
    keys.press("Space", key);
    for (let now_ms = 1020; now_ms <= 2000; now_ms += 20) keys.tick(now_ms, [0, 1]);
    near(grip.place, [0.03, 0, 0]);
    keys.lift("ArrowRight", false);
    keys.press("ArrowUp", { ...key, shift: true });
    for (let now_ms = 2020; now_ms <= 3000; now_ms += 20) keys.tick(now_ms, [-1, 0]);
    near(grip.place, [0.02, 0, 0]);
    keys.lift("Space", false);
    expect(loop.orders).toEqual(["hold", "open"]);
  });

  it("hold once for a press, however long it is; with a latch until the next", () => {
    const { loop, keys } = bench();
    keys.press("Space", key);
    keys.press("Space", { ...key, isRepeat: true });
    keys.lift("Space", false);
    keys.isLatched = true;
    keys.press("Space", key);
    keys.lift("Space", false);
    expect(loop.orders).toEqual(["hold", "open", "hold"]);
    keys.press("Space", key);
    expect(loop.orders.at(-1)).toBe("open");
  });

  it("that were down when the hand was let go of take hold of nothing by being down", () => {
    const { loop, keys, grip } = bench();
    keys.press("Space", key);
    grip.forget();
    keys.press("Space", { ...key, isRepeat: true });
    expect(loop.orders).toEqual(["hold"]);
  });

  it("let go where the focus goes, and of whatever holds at escape; C is the clutch of whatever holds", () => {
    const { loop, keys, drag } = bench();
    keys.press("Space", key);
    keys.blur();
    drag.down(at(0, 0));
    keys.press("KeyC", key);
    keys.lift("KeyC", false);
    keys.blur();
    expect(loop.orders).toEqual(["hold", "open", "hold", "clutch", "hold"]);
    keys.press("Escape", key);
    expect(loop.orders.at(-1)).toBe("open");
    expect(keys.press("KeyQ", key)).toBe(false);
  });

  it("do not draw the hand far from a handle that is held up, and let it come back", () => {
    const { keys, grip } = bench();
    keys.press("Space", key);
    keys.press("ArrowRight", key);
    grip.stretch([0.05, 0, 0]);
    for (let now_ms = 0; now_ms <= 200; now_ms += 20) keys.tick(now_ms, [0, 1]);
    near(grip.place, [0, 0, 0]);
    keys.lift("ArrowRight", false);
    keys.press("ArrowLeft", key);
    for (let now_ms = 200; now_ms <= 1200; now_ms += 20) keys.tick(now_ms, [0, 1]);
    near(grip.place, [-0.03, 0, 0]);
  });

  it("take the nearest axis for away", () => {
    expect(headingOf(0.62, 1)).toEqual([0, 1]);
    expect(headingOf(-1, 0.02)).toEqual([-1, 0]);
    // Whoever looks along -x has +y to the right.
    near(turned([1, 0, 0], [-1, 0], 1), [0, 1, 0]);
    near(turned([0, 1, 0], [0, -1], 2), [0, -2, 0]);
  });
});

describe("a gamepad", () => {
  const pad = (axes: number[], ...buttons: number[]): PadReading => ({ axes, buttons });

  it("shows the place of its stick about where it took hold, without its dead middle and without a leap", () => {
    const { stick, grip, loop } = bench();
    stick.read(pad([1, 0, 0, 0], 1), 0, [0, 1]);
    expect(loop.orders).toEqual(["hold"]);
    let before_m = 0;
    for (let now_ms = 16; now_ms <= 640; now_ms += 16) {
      stick.read(pad([-1, 0, 0, 0], 1), now_ms, [0, 1]);
      expect(Math.abs(grip.place[0] - before_m) / 0.016).toBeLessThan(0.401);
      [before_m] = grip.place;
    }
    near(grip.place, [-0.08, 0, 0]);
    for (let now_ms = 656; now_ms <= 1000; now_ms += 16) stick.read(pad([0.05, 0.05, 0, 0], 1), now_ms, [0, 1]);
    near(grip.place, [-0.04, 0, 0]);
    stick.read(pad([0, 0, 0, 0], 0), 1016, [0, 1]);
    expect(loop.orders).toEqual(["hold", "open"]);
  });

  it("carries the place by the other stick and lifts by its triggers, at most so fast", () => {
    const { stick, grip } = bench();
    const buttons = [1, 0, 0, 0, 0, 0, 0, 1];
    for (let now_ms = 0; now_ms <= 1000; now_ms += 20) stick.read(pad([0, 0, 0, -1], ...buttons), now_ms, [0, 1]);
    near(grip.place, [0, 0.03, 0.03]);
  });

  it("lets go where it is unplugged, and clutches by its second button", () => {
    const { stick, loop } = bench();
    stick.read(pad([0, 0], 1, 0), 0, [0, 1]);
    stick.read(pad([0, 0], 1, 1), 16, [0, 1]);
    stick.read(pad([0, 0], 1, 0), 32, [0, 1]);
    stick.gone();
    expect(loop.orders).toEqual(["hold", "clutch", "hold", "open"]);
  });

  it("rumbles by the share of a force, and not at all for next to none", () => {
    expect([rumbleOf(0, 4), rumbleOf(0.05, 4), rumbleOf(1, 4), rumbleOf(40, 4)]).toEqual([0, 0, 0.25, 1]);
  });
});
