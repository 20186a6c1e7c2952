// Who moves the hand, and where it is. A hand is moved by one thing at a time: who took hold first keeps it until
// letting go. The place is the device's own, in metres of the handle's frame; where it began is nobody's business, for
// the loop takes hold of the handle where that is.

import type { Triple } from "../protocol/theory";

export type By = "pointer" | "keys" | "gamepad" | "wheel";

/** The loop, as a hand has it. */
export interface Held {
  hold(): void;
  open(): void;
  clutch(): void;
  tell(at_ms: number, place_m: Triple): void;
}

/** A lift glides at this speed, m/s: a notch of a wheel is no blow. */
const LIFT_M_S = 0.06;
/** What moves by itself, at a key or a stick, draws the hand no farther from a handle that is held up than this, m. */
const MOST_STRETCH_M = 0.04;
/** A page that was busy does not make up for it, ms. */
const LONGEST_STEP_MS = 50;
/** A wheel has let go when it was still for so long, ms. */
const WHEEL_REST_MS = 250;

export class Grip {
  readonly #loop: Held;
  #place: Triple = [0, 0, 0];
  #by: By | undefined;
  #isOut = false;
  /** Still to be lifted, m. */
  #lift_m = 0;
  #stretch_m: Triple = [0, 0, 0];
  #at_ms = -Infinity;
  #wheel_ms = -Infinity;
  /** Hears of every lift, m: a drag maps the screen to the plane that the hand is in. */
  onLift: ((lift_m: number) => void) | undefined;

  constructor(loop: Held) {
    this.#loop = loop;
  }

  get by(): By | undefined {
    return this.#by;
  }

  get place(): Triple {
    return this.#place;
  }

  /** Whether the hand moves without the handle. */
  get isOut(): boolean {
    return this.#isOut;
  }

  /** Takes hold, unless something else has; whether it did, or had already. */
  take(by: By): boolean {
    // A wheel only lends a hand.
    if (this.#by === "wheel" && by !== "wheel") this.letGo("wheel");
    if (this.#by === by) return true;
    if (this.#by !== undefined) return false;
    this.#by = by;
    this.#isOut = false;
    this.#lift_m = 0;
    this.#loop.hold();
    return true;
  }

  letGo(by: By): void {
    if (this.#by !== by) return;
    this.forget();
    this.#loop.open();
  }

  /** Nobody holds any more, as the loop knows already. */
  forget(): void {
    this.#by = undefined;
    this.#isOut = false;
    this.#lift_m = 0;
  }

  /** The hand moves without the handle. */
  clutchOut(by: By): void {
    if (this.#by !== by || this.#isOut) return;
    this.#isOut = true;
    this.#loop.clutch();
  }

  /** And with it again, from where both are. */
  clutchIn(by: By): void {
    if (this.#by !== by || !this.#isOut) return;
    this.#isOut = false;
    this.#loop.hold();
  }

  /** The hand went so far, m, and was there at a time. */
  move(by: By, [x_m, y_m, z_m]: Triple, at_ms: number): void {
    if (this.#by !== by) return;
    const [x, y, z] = this.#place;
    this.#place = [x + x_m, y + y_m, z + z_m];
    this.#tell(at_ms);
  }

  /** The hand is to go so far, as long as the handle follows, m. */
  push(by: By, [x_m, y_m, z_m]: Triple, at_ms: number): void {
    const allowed = (axis: 0 | 1 | 2, way_m: number): number =>
      (MOST_STRETCH_M < this.#stretch_m[axis] * Math.sign(way_m) ? 0 : way_m);
    this.move(by, [allowed(0, x_m), allowed(1, y_m), allowed(2, z_m)], at_ms);
  }

  /** The hand is to be lifted by so much, m, whoever holds it; at a wheel's turn nobody need. */
  lift(lift_m: number, at_ms: number): void {
    if (this.#by === undefined) this.take("wheel");
    if (this.#by === "wheel") this.#wheel_ms = at_ms;
    // Turning back takes away what is left, and does not wait for it.
    this.#lift_m = this.#lift_m * lift_m < 0 ? lift_m : this.#lift_m + lift_m;
  }

  /** The handle is so far behind the hand, m. */
  stretch(stretch_m: Triple): void {
    this.#stretch_m = stretch_m;
  }

  /** Time has passed. A hand at rest has to be told of again and again, or it is let go of. */
  tick(now_ms: number): void {
    const step_ms = Math.min(Math.max(now_ms - this.#at_ms, 0), LONGEST_STEP_MS);
    const most_m = (LIFT_M_S * step_ms) / 1000;
    const lift_m = Math.min(Math.max(this.#lift_m, -most_m), most_m);
    if (this.#by !== undefined && lift_m !== 0) {
      this.#lift_m -= lift_m;
      this.#place = [this.#place[0], this.#place[1], this.#place[2] + lift_m];
      this.onLift?.(lift_m);
    }
    this.#tell(now_ms);
    if (this.#lift_m !== 0) this.#wheel_ms = Math.max(this.#wheel_ms, now_ms);
    if (this.#by === "wheel" && WHEEL_REST_MS <= now_ms - this.#wheel_ms) this.letGo("wheel");
  }

  /** Time goes on, whatever the clocks of events say. */
  #tell(at_ms: number): void {
    this.#at_ms = Math.max(this.#at_ms, at_ms);
    this.#loop.tell(this.#at_ms, this.#place);
  }
}
