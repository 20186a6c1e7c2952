// Where the processor draws, it has other things to do as well, perhaps the loop itself: whether it draws, and until
// when it is left alone after a frame.

/**
 * After a frame the processor is left alone for so many times as long as that took: nearly as long on a machine that
 * has little else to do, twice as long on one that has, as a frame longer than `BUSY_MS` tells.
 */
const REST = 0.8;
const BUSY_REST = 2;
const BUSY_MS = 60;

export class Rest {
  #isDrawing = false;
  #until_ms = Number.NEGATIVE_INFINITY;

  begin(): void {
    this.#isDrawing = true;
  }

  /** A frame is finished that took so long, or is given up. */
  end(now_ms: number, duration_ms = 0): void {
    this.#isDrawing = false;
    this.#until_ms = now_ms + (duration_ms < BUSY_MS ? REST : BUSY_REST) * duration_ms;
  }

  /** Somebody waits for the next frame. */
  breakOff(): void {
    this.#until_ms = Number.NEGATIVE_INFINITY;
  }

  isOver(now_ms: number): boolean {
    return !this.#isDrawing && this.#until_ms <= now_ms;
  }
}

/** Of the page's one processor. */
export const rest = new Rest();
