// Hands for tests: a loop that keeps what it was told, and an eye that looks straight down.

import { expect } from "vitest";
import type { Triple } from "../protocol/theory";
import { Drag, type Eye, type Ray, type Touch } from "./drag";
import { Grip } from "./grip";
import { Keys } from "./keys";
import { Stick } from "./stick";

export class Loop {
  readonly orders: string[] = [];
  readonly told: { readonly at_ms: number; readonly place_m: Triple }[] = [];
  hold(): void { this.orders.push("hold"); }
  open(): void { this.orders.push("open"); }
  clutch(): void { this.orders.push("clutch"); }
  tell(at_ms: number, place_m: Triple): void { this.told.push({ at_ms, place_m }); }
  get place(): Triple { return this.told.at(-1)?.place_m ?? [Number.NaN, 0, 0]; }
}

/** From above, a pixel is a millimetre. */
export class Camera implements Eye {
  readonly turns: [number, number][] = [];
  rayAt(x: number, y: number): Ray {
    return { from_m: [x / 1000, -y / 1000, 0.5], along: [0, 0, -1] };
  }
  turn(x: number, y: number): void { this.turns.push([x, y]); }
}

export const at = (x: number, y: number, change: Partial<Touch> = {}): Touch => ({ id: 1, kind: "mouse", x, y, at_ms: 0, buttons: 1, ...change });
export const near = (got: Triple, want: Triple): void => got.forEach((part, n) => expect(part).toBeCloseTo(want[n], 9));

export function bench(ratio = 1): { loop: Loop; grip: Grip; camera: Camera; drag: Drag; keys: Keys; stick: Stick } {
  const loop = new Loop();
  const grip = new Grip(loop);
  const camera = new Camera();
  const drag = new Drag(grip, camera, () => ({ height_m: 0.03, ratio }));
  grip.onLift = (lift_m) => drag.onLift(lift_m);
  return { loop, grip, camera, drag, keys: new Keys(grip), stick: new Stick(grip) };
}
