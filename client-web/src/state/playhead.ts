// Which moment is on show. Telemetry comes in batches, twenty-five a second or so; shown as it comes, the tool would
// jerk. The moment on show therefore runs evenly, a little more than half a batch behind the newest sample on average.

/** How far behind the newest sample, s, on average over a batch: the pictures of the cut take about as long. */
const BEHIND_S = 0.035;
/** A moment this far from where it should be jumps there: the stream began, broke off, or began anew, s. */
const JUMP_S = 0.4;
/** Share of the distance from where it should be that is made good per second. */
const GAIN_PER_S = 1.5;

export class Playhead {
  #time_s = 0;
  #shown_ms: number | undefined;

  /** The moment to show at `now_ms`, when the newest sample is of `newest_s`; never later than that. */
  at(now_ms: number, newest_s: number): number {
    const passed_s = this.#shown_ms === undefined ? 0 : (now_ms - this.#shown_ms) / 1000;
    this.#shown_ms = now_ms;
    const apart_s = newest_s - BEHIND_S - this.#time_s;
    if (JUMP_S < Math.abs(apart_s)) this.#time_s = newest_s - BEHIND_S;
    else this.#time_s += passed_s * (1 + GAIN_PER_S * apart_s);
    this.#time_s = Math.min(this.#time_s, newest_s);
    return this.#time_s;
  }
}
