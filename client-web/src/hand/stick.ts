// A gamepad: the left stick is the hand about the place where it took hold, the right one carries that place on; the
// triggers lift, the lowest button holds, the one to its right is the clutch. What is felt comes back as rumble, which
// says how strong a force is and nothing of where it points.

import type { Triple } from "../protocol/theory";
import type { Grip } from "./grip";
import { type Heading, turned } from "./keys";

/** What the browser's standard mapping gives. */
export interface PadReading {
  readonly axes: readonly number[];
  /** 0 … 1 each. */
  readonly buttons: readonly number[];
}

const HOLD = 0;
const CLUTCH = 1;
const LOWER = 6;
const RAISE = 7;
/** A stick at rest stands somewhere in here. */
const DEAD = 0.12;
const PRESSED = 0.5;
/** A stick that is pressed against its rim is so far from where it was taken hold of, m. */
const REACH_M = 0.04;
/** The hand comes after a stick that snaps at this speed, m/s: faster would be no hand's. */
const FASTEST_M_S = 0.4;
const CARRY_M_S = 0.03;
const LIFT_M_S = 0.03;
const LONGEST_STEP_MS = 50;

export class Stick {
  readonly #grip: Grip;
  #wasHeld = false;
  #wasClutched = false;
  #at_ms: number | undefined;
  #shown: readonly [number, number] = [0, 0];
  /** The button takes hold once, and lets go at the next press. */
  isLatched = false;

  constructor(grip: Grip) {
    this.#grip = grip;
  }

  read({ axes, buttons }: PadReading, now_ms: number, heading: Heading): void {
    const step_s = Math.min(Math.max(now_ms - (this.#at_ms ?? now_ms), 0), LONGEST_STEP_MS) / 1000;
    this.#at_ms = now_ms;
    const stick = about(axes[0], axes[1]);
    this.#press(PRESSED <= (buttons[HOLD] ?? 0), stick);
    this.#clutch(PRESSED <= (buttons[CLUTCH] ?? 0));
    if (this.#grip.by !== "gamepad") return;
    const shown = followed(this.#shown, stick, (FASTEST_M_S / REACH_M) * step_s);
    const way: Triple = [REACH_M * (shown[0] - this.#shown[0]), REACH_M * (shown[1] - this.#shown[1]), 0];
    this.#shown = shown;
    this.#grip.move("gamepad", turned(way, heading, 1), now_ms);
    const carry = about(axes[2], axes[3]);
    const lift = ((buttons[RAISE] ?? 0) - (buttons[LOWER] ?? 0)) * LIFT_M_S;
    const on: Triple = [carry[0] * CARRY_M_S * step_s, carry[1] * CARRY_M_S * step_s, lift * step_s];
    if (on.some((part) => part !== 0)) this.#grip.push("gamepad", turned(on, heading, 1), now_ms);
  }

  /** It was unplugged. */
  gone(): void {
    this.#wasHeld = this.#wasClutched = false;
    this.#grip.letGo("gamepad");
  }

  #press(isHeld: boolean, stick: readonly [number, number]): void {
    const isNew = isHeld && !this.#wasHeld;
    const isOver = !isHeld && this.#wasHeld;
    this.#wasHeld = isHeld;
    if (isNew && this.isLatched && this.#grip.by === "gamepad") this.#grip.letGo("gamepad");
    else if (isNew && this.#grip.take("gamepad")) this.#shown = stick;
    if (isOver && !this.isLatched) this.#grip.letGo("gamepad");
  }

  #clutch(isOut: boolean): void {
    if (isOut && !this.#wasClutched) this.#grip.clutchOut("gamepad");
    if (!isOut && this.#wasClutched) this.#grip.clutchIn("gamepad");
    this.#wasClutched = isOut;
  }
}

/** How strong to rumble for a force, 0 … 1: all of it at `full_n`. Weaker than a hand notices is nothing. */
export function rumbleOf(felt_n: number, full_n: number): number {
  const LEAST = 0.02;
  const share = Math.min(Math.max(felt_n / full_n, 0), 1);
  return share < LEAST ? 0 : share;
}

/** A stick's deflection to the right and away, without its dead middle, within the circle. */
function about(x = 0, down = 0): readonly [number, number] {
  const far = Math.hypot(x, down);
  if (far <= DEAD) return [0, 0];
  const scale = (Math.min(far, 1) - DEAD) / (1 - DEAD) / far;
  return [x * scale, -down * scale];
}

function followed(from: readonly [number, number], to: readonly [number, number], most: number): readonly [number, number] {
  const [x, y] = [to[0] - from[0], to[1] - from[1]];
  const far = Math.hypot(x, y);
  if (far <= most) return to;
  return [from[0] + (x * most) / far, from[1] + (y * most) / far];
}
