// What of the plots is on show. It outlives the panel, so that a look at another page changes nothing.

import { signal } from "@preact/signals";
import {
  FIRST_WINDOW, following, held, panned, type PlotWindow, type Reach, spanning, stretchOf, zoomed,
} from "../../state/plot_window";
import type { Stretch } from "../../state/history";
import { live } from "../store";
import type { PlotSet } from "./plot_sets";

/** Which set of plots, and which axis of what has three. */
export const plotSet = signal<PlotSet>("motion");
export const plotAxis = signal(0);
export const plotWindow = signal<PlotWindow>(FIRST_WINDOW);
/** Where the cursor stands: a share of the width, 0 left to 1 right. */
export const plotCursor = signal<number | undefined>(undefined);
/** The moment of the sample under it, s. */
export const cursorTime_s = signal<number | undefined>(undefined);

let now_s = 0;

/** To be called in each frame. */
export function passTo(moment_s: number): void {
  now_s = moment_s;
}

function reach(): Reach {
  return { oldest_s: live.history.oldest_s, now_s };
}

/** The time on show. */
export function shownStretch(): Stretch {
  return stretchOf(plotWindow.peek(), reach());
}

export const view = {
  /** Shows `factor` times as much time, about a share of the width. */
  zoom: (factor: number, share = plotCursor.peek() ?? 1): void => {
    plotWindow.value = zoomed(plotWindow.peek(), factor, share, reach());
  },
  /** Looks later, or earlier, by a share of the width. */
  pan: (share: number): void => {
    plotWindow.value = panned(plotWindow.peek(), share * plotWindow.peek().span_s, reach());
  },
  span: (span_s: number): void => {
    plotWindow.value = spanning(plotWindow.peek(), span_s, reach());
  },
  pause: (): void => {
    plotWindow.value = held(plotWindow.peek(), reach());
  },
  goOn: (): void => {
    plotWindow.value = following(plotWindow.peek());
  },
  toOldest: (): void => {
    plotWindow.value = panned(plotWindow.peek(), Number.NEGATIVE_INFINITY, reach());
  },
  startOver: (): void => {
    plotWindow.value = FIRST_WINDOW;
    plotCursor.value = undefined;
  },
  moveCursor: (by: number): void => {
    plotCursor.value = Math.min(Math.max((plotCursor.peek() ?? 1) + by, 0), 1);
  },
};
