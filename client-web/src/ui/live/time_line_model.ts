// Where strokes stand on a time line, what keys do on it, and what going on from a moment takes back.

import type { Stroke, Strokes } from "../../protocol/strokes";

export interface Span {
  readonly from_s: number;
  readonly to_s: number;
}

/** One stroke; or several that are too close for the picture to tell apart. */
export interface Mark extends Span {
  readonly strokes: readonly Stroke[];
  readonly isUndone: boolean;
  /** Where it begins and how long it is, as shares of the line. */
  readonly left: number;
  readonly width: number;
}

/** The strokes of one tool, one below the other with those of other tools. */
export interface Lane {
  readonly tool: number;
  /** Who held it when it was cut with, the last one last. */
  readonly operators: readonly string[];
  readonly marks: readonly Mark[];
}

/** A shorter mark cannot be seen, and a closer pair not told apart, px. */
const LEAST_PX = 4;
const GAP_PX = 1.5;
/** Labels under the line need so much room, and half of one at either end, px. */
const LABEL_PX = 64;
const END_PX = 24;
/** A second and its multiples that a clock knows. */
const STEPS_S = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14_400, 43_200];
/** Whoever presses an arrow key goes through the line in a hundred steps, none shorter than this, s. */
const ARROW_STEPS = 100;
const LEAST_STEP_S = 0.1;

/** Where a moment stands, 0 … 1. */
export function shareOf(time_s: number, { from_s, to_s }: Span): number {
  return from_s < to_s ? Math.min(Math.max((time_s - from_s) / (to_s - from_s), 0), 1) : 1;
}

/** The moment at a share of the line; to the millisecond, which is a tick. */
export function timeAt(share: number, { from_s, to_s }: Span): number {
  return toTick(from_s + Math.min(Math.max(share, 0), 1) * (to_s - from_s));
}

export function lanesOf({ strokes, from_s, to_s }: Strokes, width_px: number): Lane[] {
  const px = Math.max(width_px, 1);
  return [...new Set(strokes.map(({ tool }) => tool))].sort((a, b) => a - b).map((tool) => {
    const own = strokes.filter((stroke) => stroke.tool === tool).sort((a, b) => a.from_s - b.from_s);
    const marks: Mark[] = [];
    for (const stroke of own) {
      const before = marks.at(-1);
      const left = shareOf(stroke.from_s, { from_s, to_s });
      if (before?.isUndone === stroke.undone && (left - before.left - before.width) * px < GAP_PX) {
        marks[marks.length - 1] = markOf([...before.strokes, stroke], { from_s, to_s }, px);
      } else marks.push(markOf([stroke], { from_s, to_s }, px));
    }
    return { tool, operators: [...new Set(own.map(({ operator }) => operator).reverse())].reverse(), marks };
  });
}

function markOf(strokes: readonly Stroke[], span: Span, width_px: number): Mark {
  const [from_s, to_s] = [strokes[0].from_s, Math.max(...strokes.map((stroke) => stroke.to_s))];
  const left = shareOf(from_s, span);
  const width = Math.min(Math.max(shareOf(to_s, span) - left, LEAST_PX / width_px), 1);
  // The last one does not stick out of the line.
  return { strokes, isUndone: strokes[0].undone, from_s, to_s, left: Math.max(Math.min(left, 1 - width), 0), width };
}

/**
 * Moments to write under the line: whole multiples of a step that a clock knows, and that leaves room for each; none
 * that would stick out of the line.
 */
export function ticksOf({ from_s, to_s }: Span, width_px: number): number[] {
  const room = Math.max(Math.floor(width_px / LABEL_PX), 1);
  const step_s = STEPS_S.find((each) => (to_s - from_s) / each <= room) ?? 86_400 * Math.ceil((to_s - from_s) / 86_400 / room);
  const ticks: number[] = [];
  for (let time_s = Math.ceil(from_s / step_s) * step_s; time_s <= to_s; time_s += step_s) ticks.push(time_s);
  const end = END_PX / Math.max(width_px, 1);
  return ticks.filter((time_s) => {
    const share = shareOf(time_s, { from_s, to_s });
    return end <= share && share <= 1 - end;
  });
}

/** Where a key leads from a moment; at the end of the line it is now again. Nothing for a key that leads nowhere. */
export function timeAfter(key: string, at_s: number, { strokes, from_s, to_s }: Strokes): number | undefined {
  const step_s = Math.max((to_s - from_s) / ARROW_STEPS, LEAST_STEP_S);
  const edges = strokes.flatMap((stroke) => [stroke.from_s, stroke.to_s]);
  const within = (time_s: number): number => toTick(Math.min(Math.max(time_s, from_s), to_s));
  switch (key) {
    case "ArrowLeft": case "ArrowDown": return within(at_s - step_s);
    case "ArrowRight": case "ArrowUp": return within(at_s + step_s);
    case "PageDown": return within(Math.max(from_s, ...edges.filter((edge) => edge < at_s)));
    case "PageUp": return within(Math.min(to_s, ...edges.filter((edge) => at_s < edge)));
    case "Home": return from_s;
    case "End": return to_s;
    default: return undefined;
  }
}

/** What going on from a moment takes back. */
export interface TakenBack {
  /** This stroke and every later one. */
  readonly since: number;
  /** How many of them are not undone yet. */
  readonly count: number;
  /** Whether the first had begun by then: it goes as a whole, so the clay will be a little fuller than shown. */
  readonly hadBegun: boolean;
}

/** Nothing where all that was cut since is undone already. */
export function takenBackFrom(at_s: number, strokes: readonly Stroke[]): TakenBack | undefined {
  const later = strokes.filter(({ to_s, undone }) => !undone && at_s < to_s);
  if (later.length === 0) return undefined;
  const since = Math.min(...later.map(({ number }) => number));
  const taken = strokes.filter(({ number, undone }) => !undone && since <= number);
  return { since, count: taken.length, hadBegun: taken.some(({ from_s }) => from_s <= at_s) };
}

/** Who was cutting at a moment, as a screen reader says it; nothing when nobody was. */
export function cuttingAt(at_s: number, strokes: readonly Stroke[]): string | undefined {
  const under = strokes.filter(({ from_s, to_s }) => from_s <= at_s && at_s <= to_s);
  return under.length === 0 ? undefined : under.map(({ number, operator }) => `stroke ${number} of ${operator}`).join(" and ");
}

const toTick = (time_s: number): number => Number(time_s.toFixed(3));
