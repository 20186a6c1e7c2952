// How the connection does now, from counters that only ever grow.

import type { Session } from "../protocol/session";

export interface Quality {
  /** Share of the handles' packets that never came, 0 … 1, lately; nothing while none is due. */
  readonly loss: number | undefined;
  /** Late ticks per second, lately. */
  readonly latePerS: number;
}

interface Reading {
  readonly ticks: number;
  readonly lost: number;
  readonly received: number;
  readonly late_ticks: number;
}

/**
 * Over this long: short enough to follow a slider, long enough that one lost packet in a hundred can be told from two.
 */
const WINDOW_S = 3;

/** Keeps the last readings. The loop's own ticks are the clock, so a page that was asleep sees no spike. */
export class QualityTrend {
  #readings: Reading[] = [];

  add(session: Session): Quality {
    const { ticks, rate_hz, lost, late_ticks, packets_up_per_s } = session.loop;
    // The rate is measured and wavers: only differences of ticks may be divided by it.
    const since_s = (reading: Reading): number => (ticks - reading.ticks) / rate_hz;
    const last = this.#readings.at(-1);
    if (last !== undefined && (ticks < last.ticks || lost < last.lost)) this.#readings = [];
    const before = this.#readings.at(-1);
    const received = before === undefined ? 0 : before.received + packets_up_per_s * since_s(before);
    this.#readings.push({ ticks, lost, received, late_ticks });
    while (1 < this.#readings.length && WINDOW_S < since_s(this.#readings[0])) this.#readings.shift();
    const first = this.#readings[0];
    const elapsed_s = since_s(first);
    const gone = lost - first.lost;
    const due = gone + received - first.received;
    return {
      loss: 0 < due ? gone / due : undefined,
      latePerS: 0 < elapsed_s ? (late_ticks - first.late_ticks) / elapsed_s : 0,
    };
  }
}
