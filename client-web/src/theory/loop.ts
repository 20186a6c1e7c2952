// The loop of [KHMH03] under a round trip d, as far as the page draws it itself: the server gives margins, which do not
// depend on d; what the loop does at the d of the slider is found here. Symbols are those of docs/papers.md and paper
// (16)-(34):
//
//   P = G_h C_h1,  H = P T_h,  E = rho P T_t,  T_t = B_t s + K_t,  rho = A_h1 / |A_h2|
//   force exchange                 (1 + E)(1 + H) - H E exp(-s d) = 0
//   position forward, force back   1 + H + E exp(-s d) = 0
//
// With P = N / D both are A(s) + B(s) exp(-s d) = 0 with polynomials A and B. SI units, rad/s.

import type { TransferFunction } from "../protocol/theory";
import {
  complex, type Complex, derivative, exp, minus, over, plus, type Polynomial, product, scaled, size, sum, times, valueAt,
} from "./complex";

export interface LoopParts {
  readonly g_h: TransferFunction;
  readonly c_h1: TransferFunction;
  /** N per m. */
  readonly t_h: Polynomial;
  readonly position_ratio: number;
  readonly force_ratio: number;
  readonly clay_damping_n_s_per_m: number;
  readonly clay_stiffness_n_per_m: number;
}

export type DelayedScheme = "force_exchange" | "position_force";

/** `A(s) + B(s) exp(-s d)`. */
export interface Characteristic {
  readonly a: Polynomial;
  readonly b: Polynomial;
}

export function characteristic(scheme: DelayedScheme, loop: LoopParts): Characteristic {
  const d = product(loop.g_h.denominator, loop.c_h1.denominator);
  const n = product(loop.g_h.numerator, loop.c_h1.numerator);
  const rho = loop.position_ratio / Math.abs(loop.force_ratio);
  const n_h = product(n, loop.t_h);
  const n_e = product(n, [rho * loop.clay_damping_n_s_per_m, rho * loop.clay_stiffness_n_per_m]);
  if (scheme === "position_force") return { a: sum(d, n_h), b: n_e };
  return { a: product(sum(d, n_e), sum(d, n_h)), b: product([-1], product(n_e, n_h)) };
}

/** The loop gain `B/A exp(-s d)` on the axis: the loop loses its stability where this passes -1. */
export function loopGain({ a, b }: Characteristic, delay_s: number, omega_rad_s: number): Complex {
  const s = complex(0, omega_rad_s);
  return times(over(valueAt(b, s), valueAt(a, s)), exp(scaled(s, -delay_s)));
}

/** A motion that grows by itself. */
export interface Growth {
  /** Of its envelope, 1/s. */
  readonly rate_per_s: number;
  /** 0: it grows without swinging. */
  readonly frequency_hz: number;
}

/** Slower than this nothing is seen to grow within a minute, 1/s. */
const LEAST_RATE_PER_S = 0.01;
const NEWTON_STEPS = 60;

/** The motion that grows fastest at a round trip; nothing when none does. */
export function fastestGrowth(polynomials: Characteristic, delay_s: number): Growth | undefined {
  let fastest: Complex | undefined;
  for (const root of growingRoots(polynomials, delay_s)) {
    if (fastest === undefined || fastest.re < root.re) fastest = root;
  }
  return fastest === undefined ? undefined : { rate_per_s: fastest.re, frequency_hz: fastest.im / (2 * Math.PI) };
}

/**
 * Roots to the right of the axis and not below it. Such a root needs `|A| <= |B|`, which bounds it; Newton's method
 * starts from a grid over what is left, fine enough along the axis for one start within each turn of `exp(-s d)`.
 */
export function growingRoots(polynomials: Characteristic, delay_s: number): Complex[] {
  const reach = reachOf(polynomials);
  if (reach === 0) return [];
  const turns = (reach * delay_s) / (2 * Math.PI);
  const along = Math.ceil(Math.min(24 + 4 * turns, 400));
  const found: Complex[] = [];
  for (const share of [0, 0.02, 0.08, 0.25, 0.6, 1]) {
    for (let n = 0; n <= along; n += 1) {
      const start = complex(share * reach, (n / along) * reach);
      const root = newton(polynomials, delay_s, start);
      if (root === undefined || root.re < LEAST_RATE_PER_S || 2 * reach < size(root) || root.im < -1e-6 * reach) continue;
      const known = found.some((other) => size(minus(other, root)) < 1e-4 * (1 + size(root)));
      if (!known) found.push({ re: root.re, im: Math.max(root.im, 0) });
    }
  }
  return found;
}

/**
 * Beyond this distance from 0 the right half-plane has `|B| < |A|` and so no root: Cauchy's bound on A, with B against
 * it.
 */
function reachOf({ a, b }: Characteristic): number {
  const lead = a.findIndex((coefficient) => coefficient !== 0);
  const order = a.length - 1 - lead;
  if (lead < 0 || b.every((coefficient) => coefficient === 0)) return 0;
  /** `|a_0| r^n` less everything that could stand against it. */
  const rest = (r: number): number => {
    let against = 0;
    for (let n = 0; n < order; n += 1) against += Math.abs(a[a.length - 1 - n]) * r ** n;
    for (let n = 0; n < b.length; n += 1) against += Math.abs(b[b.length - 1 - n]) * r ** n;
    return Math.abs(a[lead]) * r ** order - against;
  };
  let [low, high] = [0, 1];
  while (rest(high) < 0 && high < 1e9) [low, high] = [high, 2 * high];
  for (let n = 0; n < 40; n += 1) {
    const middle = (low + high) / 2;
    if (rest(middle) < 0) low = middle;
    else high = middle;
  }
  return high;
}

function newton({ a, b }: Characteristic, delay_s: number, start: Complex): Complex | undefined {
  const [da, db] = [derivative(a), derivative(b)];
  let s = start;
  for (let n = 0; n < NEWTON_STEPS; n += 1) {
    const turn = exp(scaled(s, -delay_s));
    const value = plus(valueAt(a, s), times(valueAt(b, s), turn));
    const slope = plus(valueAt(da, s), times(minus(valueAt(db, s), scaled(valueAt(b, s), delay_s)), turn));
    const step = over(value, slope);
    if (!Number.isFinite(step.re) || !Number.isFinite(step.im)) return undefined;
    s = minus(s, step);
    if (size(step) < 1e-10 * (1 + size(s))) return s;
  }
  return undefined;
}
