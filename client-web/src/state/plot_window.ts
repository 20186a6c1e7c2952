// The time that plots show: it follows now, or stands still at a moment; and how far it can be zoomed and moved.

import { KEPT_S, type Stretch } from "./history";

/** Spans of time, s: two dozen samples at 250 Hz, and all that is kept. */
export const LEAST_SPAN_S = 0.1;
export const MOST_SPAN_S = KEPT_S;
const FIRST_SPAN_S = 10;

export interface PlotWindow {
  readonly span_s: number;
  /** The moment at the right edge; nothing: now. */
  readonly held_s: number | undefined;
}

/** What there is to be shown: the oldest sample that is kept, and the moment that counts as now, s. */
export interface Reach {
  readonly oldest_s: number;
  readonly now_s: number;
}

export const FIRST_WINDOW: PlotWindow = { span_s: FIRST_SPAN_S, held_s: undefined };

/** What is on show. It stands still while it is held; what is not kept any more is passed by what is. */
export function stretchOf({ span_s, held_s }: PlotWindow, { oldest_s, now_s }: Reach): Stretch {
  const isGone = held_s !== undefined && held_s < oldest_s;
  const to_s = held_s === undefined ? now_s : Math.min(isGone ? oldest_s + span_s : held_s, now_s);
  return { from_s: to_s - span_s, to_s };
}

/**
 * Shows `factor` times as long a time. Held, the moment at `share` of the width, 0 left to 1 right, stays where it is;
 * else now does.
 */
export function zoomed(window: PlotWindow, factor: number, share: number, reach: Reach): PlotWindow {
  const span_s = Math.min(Math.max(window.span_s * factor, LEAST_SPAN_S), MOST_SPAN_S);
  if (window.held_s === undefined) return { span_s, held_s: undefined };
  const { from_s, to_s } = stretchOf(window, reach);
  const anchor_s = from_s + share * window.span_s;
  return { span_s, held_s: endWithin(anchor_s + (1 - share) * span_s, { ...reach, least_s: Math.min(reach.oldest_s + span_s, to_s) }) };
}

/** Looks so much later, or earlier, which holds it. As late as now, it follows again. */
export function panned(window: PlotWindow, by_s: number, reach: Reach): PlotWindow {
  const { to_s } = stretchOf(window, reach);
  const held_s = endWithin(to_s + by_s, { ...reach, least_s: Math.min(reach.oldest_s + window.span_s, to_s) });
  return { span_s: window.span_s, held_s: 0 < by_s && reach.now_s <= held_s ? undefined : held_s };
}

export function held(window: PlotWindow, reach: Reach): PlotWindow {
  return { span_s: window.span_s, held_s: stretchOf(window, reach).to_s };
}

export function following(window: PlotWindow): PlotWindow {
  return { span_s: window.span_s, held_s: undefined };
}

export function spanning(window: PlotWindow, span_s: number, reach: Reach): PlotWindow {
  return zoomed(window, span_s / window.span_s, 1, reach);
}

/** No earlier than `least_s`, at which the oldest sample is at the left edge, and no later than now. */
function endWithin(end_s: number, { least_s, now_s }: { least_s: number; now_s: number }): number {
  return Math.min(Math.max(end_s, least_s), now_s);
}
