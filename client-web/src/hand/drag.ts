// Mouse, finger and pen on the picture: a drag moves the hand in the plane that the tool is in. A second finger lifts
// by how far apart the two are, and turns the view by where they go together; the middle button turns the view as well.
// The right button is the clutch.

import type { Triple } from "../protocol/theory";
import type { Grip } from "./grip";

/** From the eye through a point of the screen, m, in the clay's frame. */
export interface Ray {
  readonly from_m: Triple;
  /** Of length 1. */
  readonly along: Triple;
}

export interface Touch {
  readonly id: number;
  readonly kind: "mouse" | "touch" | "pen";
  /** CSS pixels, from the picture's upper left corner. */
  readonly x: number;
  readonly y: number;
  readonly at_ms: number;
  /** As the browser counts them: 1 left, 2 right, 4 middle. */
  readonly buttons: number;
}

/** The picture under the hand. */
export interface Eye {
  rayAt(x: number, y: number): Ray;
  /** Turns the view by a way on the screen, pixels. */
  turn(x: number, y: number): void;
}

/** Where the hand is in the clay: height of the tool, m, and how far the tool goes for a metre of the handle. */
export interface Ground {
  readonly height_m: number;
  readonly ratio: number;
}

const LEFT = 1;
const RIGHT = 2;
const MIDDLE = 4;
/** Seen flatter than this, a pixel up would be a great way off: the sine of the least angle that counts. */
const FLATTEST = 0.2;
/** Lift for each pixel that two fingers part by, m. */
const PINCH_M = 0.00015;

interface Place {
  readonly x: number;
  readonly y: number;
}

export class Drag {
  readonly #grip: Grip;
  readonly #eye: Eye;
  readonly #ground: () => Ground;
  readonly #touches = new Map<number, Place>();
  /** Drags the hand; of several fingers the first. */
  #leader: number | undefined;
  #turner: number | undefined;
  #height_m = 0;
  #ratio = 1;
  #last: Place = { x: 0, y: 0 };
  #point: readonly [number, number] = [0, 0];

  constructor(grip: Grip, eye: Eye, ground: () => Ground) {
    this.#grip = grip;
    this.#eye = eye;
    this.#ground = ground;
  }

  down(touch: Touch): void {
    this.#touches.set(touch.id, touch);
    if (touch.kind === "mouse" && (touch.buttons & MIDDLE) !== 0) {
      this.#turner = touch.id;
      return;
    }
    if (this.#leader !== undefined || (touch.buttons & LEFT) === 0 || !this.#grip.take("pointer")) return;
    this.#leader = touch.id;
    const { height_m, ratio } = this.#ground();
    this.#height_m = height_m;
    this.#ratio = ratio;
    this.#anchor(touch);
    this.#grip.move("pointer", [0, 0, 0], touch.at_ms);
  }

  move(touch: Touch): void {
    const before = this.#touches.get(touch.id);
    if (before === undefined) return;
    this.#touches.set(touch.id, touch);
    if (touch.id === this.#turner) {
      this.#eye.turn(touch.x - before.x, touch.y - before.y);
      return;
    }
    const other = this.#otherFinger(touch.id);
    if (other !== undefined) {
      this.#pinch(touch, before, other);
      return;
    }
    if (touch.id !== this.#leader) return;
    // Of a mouse with two buttons down the browser says no more than that one of them is up.
    if ((touch.buttons & LEFT) === 0) {
      this.up(touch.id);
      return;
    }
    if ((touch.buttons & RIGHT) !== 0) this.#grip.clutchOut("pointer");
    else this.#grip.clutchIn("pointer");
    const [x_m, y_m] = this.#point;
    this.#anchor(touch);
    const way = (now_m: number, before_m: number): number => (now_m - before_m) / this.#ratio;
    this.#grip.move("pointer", [way(this.#point[0], x_m), way(this.#point[1], y_m), 0], touch.at_ms);
  }

  /** The pointer has gone, or the browser has taken it away: either way nobody holds. */
  up(id: number): void {
    this.#touches.delete(id);
    if (id === this.#turner) this.#turner = undefined;
    if (id === this.#leader) {
      this.#leader = undefined;
      this.#grip.letGo("pointer");
    }
    // The finger that stays goes on from where it is.
    const leader = this.#leader === undefined ? undefined : this.#touches.get(this.#leader);
    if (leader !== undefined) this.#anchor(leader);
  }

  /** Whoever pressed has to press anew. */
  forget(): void {
    this.#touches.clear();
    this.#leader = this.#turner = undefined;
  }

  /** The hand is in another plane now; it stays where it is in that. */
  onLift(lift_m: number): void {
    if (this.#leader === undefined) return;
    this.#height_m += lift_m * this.#ratio;
    this.#anchor(this.#last);
  }

  #pinch(touch: Place & { readonly at_ms: number }, before: Place, other: Place): void {
    if (this.#grip.by !== "pointer") return;
    const apart = Math.hypot(touch.x - other.x, touch.y - other.y) - Math.hypot(before.x - other.x, before.y - other.y);
    this.#grip.lift(apart * PINCH_M, touch.at_ms);
    // One of the two has moved, and their middle by half as much; what parts them turns nothing.
    const [x, y] = [touch.x - before.x, touch.y - before.y];
    const [ax, ay] = [touch.x - other.x, touch.y - other.y];
    const square = Math.max(ax * ax + ay * ay, 1);
    const along = (x * ax + y * ay) / square;
    this.#eye.turn((x - along * ax) / 2, (y - along * ay) / 2);
  }

  #otherFinger(id: number): Place | undefined {
    if (this.#turner !== undefined || this.#touches.size < 2) return undefined;
    for (const [other, place] of this.#touches) if (other !== id) return place;
    return undefined;
  }

  #anchor({ x, y }: Place): void {
    this.#last = { x, y };
    this.#point = onPlane(this.#eye.rayAt(x, y), this.#height_m);
  }
}

/**
 * Where a ray meets the plane of a height, m; a ray that hardly goes down meets it no farther off than a steeper one.
 */
export function onPlane({ from_m, along }: Ray, height_m: number): readonly [number, number] {
  const below_m = from_m[2] - height_m;
  // From under the plane one looks up at it.
  const steep = below_m < 0 ? Math.min(-along[2], -FLATTEST) : Math.max(-along[2], FLATTEST);
  const way_m = below_m / steep;
  return [from_m[0] + way_m * along[0], from_m[1] + way_m * along[1]];
}
