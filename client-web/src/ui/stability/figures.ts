// Nyquist and Bode as figures: which curve, how much of it, and what is marked in it.

import type { FigureContent, Line, Mark } from "../../plots/figure";
import type { GainCurve } from "../../protocol/mathematics";
import type { LoopAnswer } from "../../protocol/theory";
import type { DelayedLoop } from "../../theory/loop";
import { milliseconds } from "../../theory/verdict";

export const LOOPS = ["open", "position_force", "force_exchange"] as const;
/** `open`: L = P (T_h + rho T_t) of (33), without delay; else what the round trip is in. */
export type LoopName = (typeof LOOPS)[number];

export type Curve = GainCurve;

/** Where the gain passes 1. */
interface Crossover {
  readonly omega_rad_s: number;
  readonly direction: "rises" | "falls";
}

const COLOURS: Record<LoopName, string> = { open: "--accent", position_force: "--tool", force_exchange: "--felt" };

/** Half height of the picture, by how near one looks. */
export const ZOOMS = { near: 1.4, mid: 5, far: 25 } as const;
export type Zoom = keyof typeof ZOOMS;

/** Nothing where the curve is the module's, and that is not there. */
export function curveOf(name: LoopName, answer: LoopAnswer, loop: DelayedLoop | undefined, round_trip_s: number): Curve | undefined {
  return name === "open" ? answer.nyquist : loop?.curve(name, round_trip_s);
}

export function nyquist(name: LoopName, curve: Curve, answer: LoopAnswer, zoom: Zoom, at_rad_s: number | undefined): FigureContent {
  const colour = COLOURS[name];
  const half = ZOOMS[zoom];
  const { re, im, omega_rad_s } = curve;
  const lines: Line[] = [
    { x: re, y: im.map((value) => -value), colour, width: 1.5, dash: [5, 4], opacity: 0.55 },
    { x: re, y: im, colour, width: 2.25, arrowsAt: arrows(curve, half) },
  ];
  const marks: Mark[] = [{ x: -1, y: 0, colour: "--bad", shape: "cross", text: "−1", side: "above" }];
  const nearest = name === "open" ? answer.nyquist_min_omega_rad_s : nearestToMinusOne(curve);
  if (nearest !== null) {
    const n = indexAt(omega_rad_s, nearest);
    lines.push({ x: [-1, re[n]], y: [0, im[n]], colour: "--text-faint", width: 1.25, dash: [2, 3] });
    const distance = Math.hypot(re[n] + 1, im[n]);
    marks.push({ x: re[n], y: im[n], colour, shape: "dot", text: `nearest: ${distance.toFixed(2)}`, side: "below" });
  }
  if (at_rad_s !== undefined) {
    const n = indexAt(omega_rad_s, at_rad_s);
    marks.push({ x: re[n], y: im[n], colour: "--text", shape: "ring", text: frequency(omega_rad_s[n]) });
  }
  return {
    x: { label: "real part", scale: "linear", range: [-1.45 * half, 1.05 * half] },
    y: { label: "imaginary part", scale: "linear", range: [-half, half] },
    equal: true,
    circles: [{ x: 0, y: 0, radius: 1, colour: "--text-faint", dash: [3, 4] }],
    rules: [{ along: "x", at: 0, colour: "--text-faint" }, { along: "y", at: 0, colour: "--text-faint" }],
    lines,
    marks,
  };
}

export function bodeMagnitude(name: LoopName, curve: Curve, answer: LoopAnswer, at_rad_s: number | undefined): FigureContent {
  const colour = COLOURS[name];
  const { omega_rad_s } = curve;
  const magnitude_db = curve.re.map((re, n) => 20 * Math.log10(Math.hypot(re, curve.im[n])));
  const marks: Mark[] = crossovers(curve).map(({ omega_rad_s: omega }) => ({ x: omega, y: 0, colour, shape: "dot" }));
  const gain = name === "open" ? answer.gain_margin_increase : null;
  const omega = gain?.omega_rad_s ?? null;
  if (gain !== null && omega !== null) {
    marks.push({ x: omega, y: -20 * Math.log10(gain.factor), colour: "--bad", shape: "ring", text: `gain margin ×${gain.factor.toPrecision(3)}` });
  }
  mark(marks, omega_rad_s, magnitude_db, at_rad_s, (value) => `${value.toFixed(1)} dB`);
  return {
    x: { label: "", scale: "log", range: spanOf(curve) },
    y: { label: "magnitude, dB", scale: "linear", range: [-60, 40], step: 20 },
    rules: [{ along: "x", at: 0, colour: "--text-faint", dash: [4, 3] }],
    lines: [{ x: omega_rad_s, y: magnitude_db, colour }],
    marks,
  };
}

export function bodePhase(name: LoopName, curve: Curve, at_rad_s: number | undefined): FigureContent {
  const colour = COLOURS[name];
  const { omega_rad_s } = curve;
  const phase_deg = unwrapped(curve);
  const marks: Mark[] = crossovers(curve).map(({ omega_rad_s: omega, direction }) => {
    const phase = between(omega_rad_s, phase_deg, omega);
    const dot = { x: omega, y: phase, colour, shape: "dot" } as const;
    // Where the gain rises through 1 again, a lag is no margin.
    if (direction === "rises") return dot;
    return { ...dot, text: phase < -180 ? `too late by ${(-180 - phase).toFixed(0)}°` : `phase margin ${(180 + phase).toFixed(0)}°` };
  });
  mark(marks, omega_rad_s, phase_deg, at_rad_s, (value) => `${value.toFixed(0)}°`);
  return {
    x: { label: "frequency, rad/s", scale: "log", range: spanOf(curve) },
    y: { label: "phase, degrees", scale: "linear", range: phaseRange(phase_deg), step: 90 },
    rules: [{ along: "x", at: -180, colour: "--bad", dash: [4, 3], text: "−180°" }],
    lines: [{ x: omega_rad_s, y: phase_deg, colour }],
    marks,
  };
}

/** At most the last three: below them a delay has turned nothing yet. */
function crossovers({ omega_rad_s, re, im }: Curve): Crossover[] {
  const found: Crossover[] = [];
  for (let n = 1; n < omega_rad_s.length; n += 1) {
    const [a, b] = [Math.log(Math.hypot(re[n - 1], im[n - 1])), Math.log(Math.hypot(re[n], im[n]))];
    if ((a < 0) === (b < 0)) continue;
    const omega = omega_rad_s[n - 1] * (omega_rad_s[n] / omega_rad_s[n - 1]) ** (a / (a - b));
    found.push({ omega_rad_s: omega, direction: a < b ? "rises" : "falls" });
  }
  return found.slice(-3);
}

/** In words, for who does not see the picture. */
export function describeCurve(name: LoopName, curve: Curve, round_trip_s: number): string {
  const nearest = nearestToMinusOne(curve);
  const n = indexAt(curve.omega_rad_s, nearest);
  const which = name === "open" ? "the loop gain L without delay" : `the loop gain of ${name.replace("_", "–")} at ${milliseconds(round_trip_s)}`;
  return `Nyquist diagram of ${which}; it comes within ${Math.hypot(curve.re[n] + 1, curve.im[n]).toFixed(2)} of −1 at ${frequency(nearest)}`;
}

/** What the cursor shows, in words. */
export function describeAt(curve: Curve, at_rad_s: number): string {
  const n = indexAt(curve.omega_rad_s, at_rad_s);
  const magnitude_db = 20 * Math.log10(Math.hypot(curve.re[n], curve.im[n]));
  return `${frequency(curve.omega_rad_s[n])}: ${magnitude_db.toFixed(1)} dB, ${unwrapped(curve)[n].toFixed(0)}°`;
}

export function frequency(omega_rad_s: number): string {
  return `${omega_rad_s.toPrecision(2)} rad/s = ${(omega_rad_s / (2 * Math.PI)).toPrecision(2)} Hz`;
}

function nearestToMinusOne({ omega_rad_s, re, im }: Curve): number {
  let [nearest, least] = [omega_rad_s[0], Number.POSITIVE_INFINITY];
  omega_rad_s.forEach((omega, n) => {
    const distance = Math.hypot(re[n] + 1, im[n]);
    if (distance < least) [nearest, least] = [omega, distance];
  });
  return nearest;
}

/** The value at a frequency between two samples, along the logarithm of frequency. */
function between(omegas_rad_s: readonly number[], values: readonly number[], at_rad_s: number): number {
  const after = Math.min(Math.max(omegas_rad_s.findIndex((omega) => at_rad_s <= omega), 1), omegas_rad_s.length - 1);
  const [a, b] = [Math.log(omegas_rad_s[after - 1]), Math.log(omegas_rad_s[after])];
  const share = (Math.log(at_rad_s) - a) / (b - a);
  return values[after - 1] + share * (values[after] - values[after - 1]);
}

/** The place of the frequency next to a wanted one. */
function indexAt(omega_rad_s: readonly number[], wanted: number): number {
  let best = 0;
  omega_rad_s.forEach((omega, n) => {
    if (Math.abs(Math.log(omega / wanted)) < Math.abs(Math.log(omega_rad_s[best] / wanted))) best = n;
  });
  return best;
}

/** Two arrows where they can be seen: within the picture, and away from the origin. */
function arrows({ re, im }: Curve, half: number): number[] {
  const inside = re.map((x, n) => [n, Math.hypot(x, im[n])] as const).filter(([, r]) => 0.25 * half < r && r < 0.95 * half).map(([n]) => n);
  return inside.length < 4 ? inside.slice(0, 1) : [inside[Math.floor(inside.length / 3)], inside[Math.floor((2 * inside.length) / 3)]];
}

function mark(marks: Mark[], x: readonly number[], y: readonly number[], at: number | undefined, text: (value: number) => string): void {
  if (at === undefined) return;
  const n = indexAt(x, at);
  marks.push({ x: x[n], y: y[n], colour: "--text", shape: "ring", text: text(y[n]) });
}

/** Phase without jumps, degrees; it begins between −270 and 90. */
function unwrapped({ re, im }: Curve): number[] {
  const out: number[] = [];
  let turns = 0;
  let last = 0;
  re.forEach((x, n) => {
    const angle = Math.atan2(im[n], x);
    if (n === 0) turns = Math.PI / 2 < angle ? -1 : 0;
    else {
      if (Math.PI < angle - last) turns -= 1;
      if (Math.PI < last - angle) turns += 1;
    }
    last = angle;
    out.push((180 / Math.PI) * (angle + 2 * Math.PI * turns));
  });
  return out;
}

/** The frequencies on show, rad/s. */
export function spanOf({ omega_rad_s }: Curve): [number, number] {
  return [Math.max(omega_rad_s[0], 1e-2), Math.min(omega_rad_s[omega_rad_s.length - 1], 1e3)];
}

/** As much of the phase as a figure can show: a delay turns it for ever. */
function phaseRange(phase_deg: readonly number[]): [number, number] {
  const greatest = Math.max(...phase_deg.slice(0, phase_deg.length / 2));
  return [-360, Math.max(0, Math.ceil(greatest / 90) * 90)];
}
