// What counts of the worker come to over time: how many ticks a second, and whether something happens now.

/** Over so long a rate is taken, and so long something counts as now, ms. */
const WINDOW_MS = 1000;

/** Ticks a second over the last second. */
export class TickRate {
  readonly #told: { readonly ticks: number; readonly at_ms: number }[] = [];

  /** Takes in a count; the rate, once there is half a second to count. */
  add(ticks: number, at_ms: number): number | undefined {
    const last = this.#told.at(-1);
    // A loop that was made anew counts anew.
    if (last !== undefined && ticks < last.ticks) this.#told.length = 0;
    this.#told.push({ ticks, at_ms });
    while (2 < this.#told.length && this.#told[1].at_ms <= at_ms - WINDOW_MS) this.#told.shift();
    const [first] = this.#told;
    const span_ms = at_ms - first.at_ms;
    return span_ms < WINDOW_MS / 2 ? undefined : (1000 * (ticks - first.ticks)) / span_ms;
  }
}

/** Whether a count has risen within the last second. */
export class Rising {
  #count: number | undefined;
  #rose_ms = -Infinity;

  add(count: number, at_ms: number): boolean {
    if (this.#count !== undefined && this.#count < count) this.#rose_ms = at_ms;
    this.#count = count;
    return at_ms < this.#rose_ms + WINDOW_MS;
  }
}
