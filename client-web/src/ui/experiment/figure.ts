// Fig. 7: velocity against position, the theory's steps over what was measured.

import type { FigureContent, Line, Mark } from "../../plots/figure";
import type { AxisSpec } from "../../plots/figure_axis";
import type { CuttingAnswer, CuttingRequest } from "../../protocol/theory";
import { rangesOf } from "./model";
import type { LivePath, Passage } from "./passing";

const CM = 100;
/** Room about the data, share of it. */
const ROOM = 0.14;

export function fig7(now: CuttingRequest, asked: CuttingRequest | undefined, answer: CuttingAnswer | undefined): FigureContent {
  const ranges = rangesOf(now);
  const lines: Line[] = [];
  const marks: Mark[] = [];
  if (answer !== undefined) {
    const { position_m, velocity_m_s } = answer.trace;
    lines.push({ x: position_m.map(inCm), y: velocity_m_s.map(inCm), colour: "--tool", width: 2.5 });
  }
  // The theory over the measurement, and thinner, so that both are seen where they agree.
  const theory = answer !== undefined && asked === now ? answer.plateau_velocity_m_s : ranges.map(({ theory_m_s }) => theory_m_s);
  drawTheory(ranges.map(({ from_m, to_m }, n) => ({ from_m, to_m, at_m_s: theory[n] })), lines, marks);
  return {
    x: xAxis(ranges[0].from_m, ranges[ranges.length - 1].to_m),
    y: yAxis([...theory, ...(answer?.trace.velocity_m_s ?? [])]),
    bands: ranges.map(({ from_m, to_m, clay_damping_n_s_per_m: clay }, n) => ({
      from: from_m * CM, to: to_m * CM, colour: bandColour(n), text: `${clay} N·s/m`,
    })),
    lines,
    marks,
  };
}

/** The same from the running session, as it goes on. */
export function liveFig7(path: LivePath, passages: readonly Passage[]): FigureContent {
  const lines: Line[] = [{ x: path.position_m.map(inCm), y: path.velocity_m_s.map(inCm), colour: "--hand", width: 2 }];
  const marks: Mark[] = [];
  const levels = passages.flatMap(({ from_m, to_m, theory_m_s }) => (theory_m_s === undefined ? [] : [{ from_m, to_m, at_m_s: theory_m_s }]));
  drawTheory(levels, lines, marks);
  const last = path.position_m.length - 1;
  if (0 <= last) marks.push({ x: inCm(path.position_m[last]), y: inCm(path.velocity_m_s[last]), colour: "--hand", shape: "dot", text: "now", side: "below" });
  const edges = passages.flatMap(({ from_m, to_m }) => [from_m, to_m]);
  const [least, greatest] = extent([...path.position_m, ...edges], [0, 0.01]);
  return {
    x: xAxis(least, greatest),
    y: yAxis([...levels.map(({ at_m_s }) => at_m_s), ...path.velocity_m_s]),
    bands: passages.map(({ from_m, to_m, top_m }, n) => ({ from: from_m * CM, to: to_m * CM, colour: bandColour(n), text: `${(100 * top_m).toFixed(1)} cm high` })),
    rules: [{ along: "x", at: 0, colour: "--text-faint" }],
    lines,
    marks,
  };
}

const inCm = (metres: number): number => CM * metres;
const bandColour = (n: number): string => (n % 2 === 0 ? "--accent" : "--felt");

interface Level {
  readonly from_m: number;
  readonly to_m: number;
  readonly at_m_s: number;
}

/** A level over each range; nothing joins them, for the theory says nothing of the way from one to the next. */
function drawTheory(levels: readonly Level[], lines: Line[], marks: Mark[]): void {
  const x: number[] = [];
  const y: number[] = [];
  for (const { from_m, to_m, at_m_s } of levels) {
    x.push(inCm(from_m), inCm(to_m), inCm(to_m));
    y.push(inCm(at_m_s), inCm(at_m_s), Number.NaN);
    marks.push({ x: inCm((from_m + to_m) / 2), y: inCm(at_m_s), colour: "--text", shape: "ring", text: `${inCm(at_m_s).toFixed(2)} cm/s`, side: "above" });
  }
  lines.push({ x, y, colour: "--text", width: 1.5, dash: [7, 4] });
}

function xAxis(from_m: number, to_m: number): AxisSpec {
  const room_m = 0.05 * (to_m - from_m);
  return { label: "position of the handle, cm", scale: "linear", range: [inCm(from_m - room_m), inCm(to_m + room_m)] };
}

function yAxis(velocities_m_s: readonly number[]): AxisSpec {
  const [low, high] = extent([0, ...velocities_m_s], [0, 0]).map(inCm);
  const room = ROOM * Math.max(high - low, 0.1);
  return { label: "velocity of the handle, cm/s", scale: "linear", range: [low < -0.02 * high ? low - room : 0, high + room] };
}

/** Least and greatest of the values; `otherwise` when there are none. */
function extent(values: readonly number[], otherwise: [number, number]): [number, number] {
  if (values.length === 0) return otherwise;
  return values.reduce<[number, number]>(([least, greatest], value) => [Math.min(least, value), Math.max(greatest, value)],
    [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY]);
}
