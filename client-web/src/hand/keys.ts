// The hand on a keyboard: arrows move it at a steady speed, page up and down lift it, space holds it, C is the clutch,
// shift makes it slow, escape lets go.

import type { Triple } from "../protocol/theory";
import type { Grip } from "./grip";

/** m/s: a block of 128 mm in four seconds, and with shift a voxel in a twentieth of one. */
const SPEED_M_S = 0.03;
const SLOW_M_S = 0.01;

/** Ways as somebody in front of the picture sees them: to the right, away, up. */
const WAYS: Readonly<Record<string, Triple>> = {
  ArrowRight: [1, 0, 0], ArrowLeft: [-1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1],
};
const HOLD = "Space";
const CLUTCH = "KeyC";
const LET_GO = "Escape";

/** The way that is away from whoever looks, along the axis that is nearest to it. */
export type Heading = readonly [1 | 0 | -1, 1 | 0 | -1];

export class Keys {
  readonly #grip: Grip;
  readonly #pressed = new Set<string>();
  #at_ms: number | undefined;
  #isSlow = false;
  /** Space takes hold once, and lets go at the next press: for whoever presses one key at a time. */
  isLatched = false;

  constructor(grip: Grip) {
    this.#grip = grip;
  }

  /** Whether the key is one of the hand's; `isRepeat`: it was down all along. */
  press(code: string, { isRepeat, shift }: { readonly isRepeat: boolean; readonly shift: boolean }): boolean {
    this.#isSlow = shift;
    if (code in WAYS) {
      this.#pressed.add(code);
      return true;
    }
    if (code !== HOLD && code !== CLUTCH && code !== LET_GO) return false;
    if (isRepeat) return true;
    if (code === HOLD) this.#pressHold();
    else if (code === CLUTCH) this.#pressClutch();
    else if (this.#grip.by !== undefined) this.#grip.letGo(this.#grip.by);
    return true;
  }

  lift(code: string, shift: boolean): void {
    this.#isSlow = shift;
    this.#pressed.delete(code);
    if (code === HOLD && !this.isLatched) this.#grip.letGo("keys");
    if (code === CLUTCH && this.#grip.by !== undefined) this.#grip.clutchIn(this.#grip.by);
  }

  /** The keyboard is somebody else's now, who will not say which keys were let go of. */
  blur(): void {
    this.#pressed.clear();
    this.#grip.letGo("keys");
  }

  tick(now_ms: number, heading: Heading): void {
    const step_s = Math.min(Math.max(now_ms - (this.#at_ms ?? now_ms), 0), 50) / 1000;
    this.#at_ms = now_ms;
    const way = [...this.#pressed].reduce<Triple>((sum, code) => plus(sum, WAYS[code]), [0, 0, 0]);
    if (this.#grip.by !== "keys" || way.every((part) => part === 0)) return;
    const far_m = (this.#isSlow ? SLOW_M_S : SPEED_M_S) * step_s;
    this.#grip.push("keys", turned(way, heading, far_m), now_ms);
  }

  #pressHold(): void {
    if (this.isLatched && this.#grip.by === "keys") this.#grip.letGo("keys");
    else this.#grip.take("keys");
  }

  #pressClutch(): void {
    if (this.#grip.by !== undefined) this.#grip.clutchOut(this.#grip.by);
  }
}

/** A way as it is seen, in the clay's frame, `far_m` for each part. */
export function turned([right, away, up]: Triple, [x, y]: Heading, far_m: number): Triple {
  return [far_m * (right * y + away * x), far_m * (away * y - right * x), far_m * up];
}

/** The axis that is nearest to a way, as a heading. */
export function headingOf(x: number, y: number): Heading {
  if (Math.abs(x) <= Math.abs(y)) return [0, y < 0 ? -1 : 1];
  return [x < 0 ? -1 : 1, 0];
}

function plus(a: Triple, b: Triple): Triple {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}
