import { describe, expect, it } from "vitest";
import { builtHand, bytesOf, recordedStroke } from "../protocol/built_hand";
import type { Triple } from "../protocol/theory";
import { Drag, type Eye, onPlane, type Touch } from "./drag";
import { at, bench, Camera, near } from "./fake_loop";
import { Grip } from "./grip";

describe("a ray", () => {
  it("meets the plane of a height where a straight line does", () => {
    const along: Triple = [0.48, 0.6, -0.64];
    const [x, y] = onPlane({ from_m: [0.1, -0.2, 0.35], along }, 0.03);
    // Down by 0.32 m is half a metre along.
    expect([x, y]).toEqual([expect.closeTo(0.1 + 0.24, 12), expect.closeTo(-0.2 + 0.3, 12)]);
  });

  it("that hardly goes down, or up and away, meets it at no great distance and without a leap", () => {
    let before: readonly [number, number] | undefined;
    for (let angle = -0.6; angle < 1.2; angle += 0.001) {
      const point = onPlane({ from_m: [0, 0, 0.13], along: [0, Math.cos(angle), -Math.sin(angle)] }, 0.03);
      expect(Math.abs(point[1])).toBeLessThanOrEqual(0.5);
      if (before !== undefined) expect(Math.abs(point[1] - before[1])).toBeLessThan(0.004);
      before = point;
    }
    const below = onPlane({ from_m: [0, 0, -0.1], along: [0, 0.6, 0.8] }, 0.02);
    expect(below[1]).toBeCloseTo(0.09, 12);
  });
});

describe("a drag", () => {
  it("holds while the button is down and takes the hand along, whatever it was before", () => {
    const { loop, drag, grip } = bench(2);
    drag.down(at(100, 100));
    drag.move(at(130, 90, { at_ms: 8 }));
    expect(loop.orders).toEqual(["hold"]);
    // The tool goes 30 mm for a handle that goes 15.
    near(loop.place, [0.015, 0.005, 0]);
    drag.up(1);
    drag.move(at(200, 200, { at_ms: 9 }));
    expect(loop.orders).toEqual(["hold", "open"]);
    near(grip.place, [0.015, 0.005, 0]);
    drag.down(at(0, 0, { at_ms: 20 }));
    near(loop.place, [0.015, 0.005, 0]);
  });

  it("with the right button down as well is the clutch", () => {
    const { loop, drag } = bench();
    drag.down(at(0, 0));
    drag.move(at(0, 0, { buttons: 3 }));
    drag.move(at(50, 0, { buttons: 3 }));
    drag.move(at(50, 0, { buttons: 1 }));
    expect(loop.orders).toEqual(["hold", "clutch", "hold"]);
    near(loop.place, [0.05, 0, 0]);
    drag.move(at(50, 0, { buttons: 3 }));
    drag.move(at(60, 0, { buttons: 2 }));
    drag.move(at(90, 0, { buttons: 2 }));
    expect(loop.orders).toEqual(["hold", "clutch", "hold", "clutch", "open"]);
    near(loop.place, [0.05, 0, 0]);
  });

  it("with the middle button turns the view, and no other button takes hold", () => {
    const { loop, drag, camera } = bench();
    drag.down(at(0, 0, { buttons: 4 }));
    drag.move(at(5, 7, { buttons: 4 }));
    drag.up(1);
    drag.down(at(0, 0, { buttons: 2 }));
    expect([loop.orders, camera.turns]).toEqual([[], [[5, 7]]]);
  });

  it("with a second finger lifts as they part and turns as they go together; the hand stays where it is", () => {
    const { loop, drag, grip, camera } = bench();
    const finger = (id: number, x: number, y: number): Touch => at(x, y, { id, kind: "touch" });
    drag.down(finger(1, 0, 0));
    drag.down(finger(2, 100, 0));
    drag.move(finger(2, 200, 0));
    expect(camera.turns.every(([x, y]) => Math.abs(x) + Math.abs(y) < 1e-9)).toBe(true);
    for (let now_ms = 0; now_ms < 1000; now_ms += 16) grip.tick(now_ms);
    near(loop.place, [0, 0, 0.015]);
    drag.move(finger(2, 200, 40));
    drag.move(finger(1, 0, 40));
    const [x, y] = camera.turns.reduce(([a, b], [c, d]) => [a + c, b + d], [0, 0]);
    expect(y).toBeGreaterThan(35);
    expect(Math.abs(x)).toBeLessThan(10);
    const before = loop.place;
    drag.up(2);
    drag.move(finger(1, 10, 40));
    near(loop.place, [before[0] + 0.01, before[1], before[2]]);
  });

  it("that was dropped moves nothing until somebody presses anew", () => {
    const { loop, drag, grip } = bench();
    drag.down(at(0, 0));
    grip.forget();
    drag.forget();
    drag.move(at(50, 0));
    drag.up(1);
    expect(loop.orders).toEqual(["hold"]);
    near(grip.place, [0, 0, 0]);
    drag.down(at(0, 0));
    expect(loop.orders).toEqual(["hold", "hold"]);
  });
});

describe("a wheel", () => {
  it("lifts at a steady speed, holding for as long as it takes", () => {
    const { loop, grip } = bench();
    grip.tick(0);
    grip.lift(0.006, 0);
    let slowest_ms = 0;
    for (let now_ms = 16; now_ms < 1000; now_ms += 16) {
      grip.tick(now_ms);
      if (loop.place[2] < 0.006 - 1e-9) slowest_ms = now_ms;
    }
    near(loop.place, [0, 0, 0.006]);
    expect(slowest_ms).toBeGreaterThan(70);
    expect(slowest_ms).toBeLessThan(120);
    expect(loop.orders).toEqual(["hold", "open"]);
  });

  it("turned back leaves nothing of what it was to do before; a hand that takes hold has none of it", () => {
    const { loop, grip, keys } = bench();
    grip.tick(0);
    grip.lift(0.05, 0);
    grip.tick(16);
    const raised_m = loop.place[2];
    grip.lift(-0.001, 16);
    for (let now_ms = 32; now_ms < 200; now_ms += 16) grip.tick(now_ms);
    expect(loop.place[2]).toBeCloseTo(raised_m - 0.001, 9);
    grip.lift(0.05, 200);
    keys.press("Space", { isRepeat: false, shift: false });
    const { place } = grip;
    grip.tick(260);
    expect(grip.place).toEqual(place);
    expect(grip.by).toBe("keys");
  });

  it("lifts the plane of a drag, which goes on without a leap", () => {
    const { loop, grip, drag } = bench();
    const tilted: Eye = {
      rayAt: (x) => {
        const far = Math.hypot(x / 1000, 1);
        return { from_m: [0, -0.4, 0.43], along: [x / 1000 / far, 0.6 / far, -0.8 / far] };
      },
      turn: () => undefined,
    };
    const slanted = new Drag(grip, tilted, () => ({ height_m: 0.03, ratio: 1 }));
    grip.onLift = (lift_m) => slanted.onLift(lift_m);
    drag.forget();
    grip.tick(0);
    slanted.down(at(0, 0));
    grip.lift(0.04, 0);
    for (let now_ms = 16; now_ms < 1000; now_ms += 16) grip.tick(now_ms);
    slanted.move(at(0, 0, { at_ms: 1000 }));
    near(loop.place, [0, 0, 0.04]);
    // Nearer to the eye by a tenth, the same way on the screen is a shorter one.
    slanted.move(at(100, 0, { at_ms: 1010 }));
    near(loop.place, [0.1 * (0.4 - 0.04) / 0.8, 0, 0.04]);
  });
});

describe("one hand", () => {
  it("is moved by one thing at a time, in time that goes on", () => {
    const { loop, grip, drag, keys, stick } = bench();
    drag.down(at(0, 0, { at_ms: 100 }));
    keys.press("Space", { isRepeat: false, shift: false });
    keys.press("ArrowUp", { isRepeat: false, shift: false });
    keys.tick(100, [0, 1]);
    keys.tick(150, [0, 1]);
    stick.read({ axes: [1, 1], buttons: [1] }, 150, [0, 1]);
    near(grip.place, [0, 0, 0]);
    grip.tick(160);
    drag.move(at(10, 0, { at_ms: 140 }));
    expect(loop.orders).toEqual(["hold"]);
    expect(loop.told.map(({ at_ms }) => at_ms)).toEqual([100, 160, 160]);
    drag.up(1);
    expect(keys.press("Space", { isRepeat: false, shift: false })).toBe(true);
    expect(grip.by).toBe("keys");
  });

  it("takes the module's handle along as far as it goes itself, through the spring", async () => {
    const module = await builtHand();
    const { keys: leaseKeys, granted } = recordedStroke();
    module.begin(0, { keys: bytesOf(leaseKeys), granted }, { rate_hz: 60, motion: 1 });
    let now_ms = 0;
    const grip = new Grip({
      hold: () => module.hold(),
      open: () => module.release(),
      clutch: () => module.clutch(),
      tell: (at_ms, place_m) => module.tell(now_ms, at_ms, place_m),
    });
    const drag = new Drag(grip, new Camera(), () => ({ height_m: 0.03, ratio: 1 }));
    const frame = (): void => {
      now_ms += 16;
      grip.tick(now_ms);
      for (let wake_ms = now_ms - 12; wake_ms <= now_ms; wake_ms += 4) module.advance(wake_ms);
    };
    for (let n = 0; n < 10; n += 1) frame();
    expect(module.look()?.handle_m).toEqual([0, 0, 0]);
    drag.down(at(0, 0, { at_ms: now_ms }));
    for (let n = 0; n < 20; n += 1) {
      drag.move(at(n, 0, { at_ms: now_ms }));
      frame();
    }
    for (let n = 0; n < 200; n += 1) frame();
    const held = module.look();
    expect(held?.grasp).toBe("held");
    expect(held?.handle_m[0]).toBeCloseTo(0.019, 3);
    drag.up(1);
    for (let n = 0; n < 30; n += 1) frame();
    expect(module.look()?.grasp).toBe("released");
    expect(module.look()?.hand_force_n).toEqual([0, 0, 0]);
  });
});
