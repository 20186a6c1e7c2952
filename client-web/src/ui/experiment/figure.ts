// Fig. 7: velocity against position, the theory's steps over what was measured.

import type { FigureContent, Line, Mark } from "../../plots/figure";
import type { CuttingAnswer, CuttingRequest } from "../../protocol/theory";
import { rangesOf } from "./model";

const CM = 100;
/** Room about the data, share of it. */
const ROOM = 0.14;

/** Where the running session's hand was and how fast it went, m and m/s. */
export interface LivePath {
  readonly position_m: readonly number[];
  readonly velocity_m_s: readonly number[];
}

export function fig7(now: CuttingRequest, asked: CuttingRequest | undefined, answer: CuttingAnswer | undefined, live: LivePath | undefined): FigureContent {
  const ranges = rangesOf(now);
  const lines: Line[] = [];
  const marks: Mark[] = [];
  if (live !== undefined) {
    lines.push({ x: live.position_m.map(inCm), y: live.velocity_m_s.map(inCm), colour: "--hand", width: 1.5, opacity: 0.8 });
    const last = live.position_m.length - 1;
    if (0 <= last) marks.push({ x: inCm(live.position_m[last]), y: inCm(live.velocity_m_s[last]), colour: "--hand", shape: "dot", text: "live", side: "above" });
  }
  if (answer !== undefined) {
    const { position_m, velocity_m_s } = answer.trace;
    lines.push({ x: position_m.map(inCm), y: velocity_m_s.map(inCm), colour: "--tool", width: 2.5 });
  }
  // The theory over the measurement, and thinner, so that both are seen where they agree.
  const theory = answer !== undefined && asked === now ? answer.plateau_velocity_m_s : ranges.map(({ theory_m_s }) => theory_m_s);
  const steps = stepped(ranges.map(({ from_m, to_m }, n) => ({ from_m, to_m, at: theory[n] })));
  lines.push({ x: steps.x, y: steps.y, colour: "--text", width: 1.5, dash: [7, 4] });
  ranges.forEach(({ from_m, to_m }, n) => {
    marks.push({ x: inCm((from_m + to_m) / 2), y: inCm(theory[n]), colour: "--text", shape: "ring", text: `${inCm(theory[n]).toFixed(2)} cm/s`, side: "above" });
  });
  return {
    x: { label: "position of the handle, cm", scale: "linear", range: widened([ranges[0].from_m * CM, ranges[ranges.length - 1].to_m * CM], 0.05) },
    y: { label: "velocity of the handle, cm/s", scale: "linear", range: velocities(theory, answer, live) },
    bands: ranges.map(({ from_m, to_m, clay_damping_n_s_per_m: clay }, n) => ({
      from: from_m * CM, to: to_m * CM, colour: n % 2 === 0 ? "--accent" : "--felt", text: `${clay} N·s/m`,
    })),
    rules: live === undefined ? [] : [{ along: "x", at: 0, colour: "--text-faint" }],
    lines,
    marks,
  };
}

const inCm = (metres: number): number => CM * metres;

/** A level over each range; nothing joins them, for the theory says nothing of the way from one to the next. */
function stepped(levels: readonly { from_m: number; to_m: number; at: number }[]): { x: number[]; y: number[] } {
  const x: number[] = [];
  const y: number[] = [];
  for (const { from_m, to_m, at } of levels) {
    x.push(inCm(from_m), inCm(to_m), inCm(to_m));
    y.push(inCm(at), inCm(at), Number.NaN);
  }
  return { x, y };
}

function velocities(theory: readonly number[], answer: CuttingAnswer | undefined, live: LivePath | undefined): [number, number] {
  const all = [0, ...theory, ...(answer?.trace.velocity_m_s ?? []), ...(live?.velocity_m_s ?? [])].map(inCm);
  const [low, high] = all.reduce<[number, number]>(([least, greatest], v) => [Math.min(least, v), Math.max(greatest, v)], [0, 0]);
  const room = ROOM * (high - low);
  return [low < -0.02 * high ? low - room : 0, high + room];
}

function widened([low, high]: readonly [number, number], share: number): [number, number] {
  return [low - share * (high - low), high + share * (high - low)];
}
