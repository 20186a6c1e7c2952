// Complex numbers and polynomials with real coefficients, highest power first.

export interface Complex {
  readonly re: number;
  readonly im: number;
}

export const complex = (re: number, im = 0): Complex => ({ re, im });
export const plus = (a: Complex, b: Complex): Complex => ({ re: a.re + b.re, im: a.im + b.im });
export const minus = (a: Complex, b: Complex): Complex => ({ re: a.re - b.re, im: a.im - b.im });
export const times = (a: Complex, b: Complex): Complex => ({ re: a.re * b.re - a.im * b.im, im: a.re * b.im + a.im * b.re });
export const scaled = (a: Complex, factor: number): Complex => ({ re: a.re * factor, im: a.im * factor });
export const size = (a: Complex): number => Math.hypot(a.re, a.im);

export function over(a: Complex, b: Complex): Complex {
  const square = b.re * b.re + b.im * b.im;
  return { re: (a.re * b.re + a.im * b.im) / square, im: (a.im * b.re - a.re * b.im) / square };
}

export function exp(a: Complex): Complex {
  const length = Math.exp(a.re);
  return { re: length * Math.cos(a.im), im: length * Math.sin(a.im) };
}

export type Polynomial = readonly number[];

export function valueAt(polynomial: Polynomial, s: Complex): Complex {
  let sum = complex(0);
  for (const coefficient of polynomial) sum = plus(times(sum, s), complex(coefficient));
  return sum;
}

export function derivative(polynomial: Polynomial): Polynomial {
  const order = polynomial.length - 1;
  return polynomial.slice(0, order).map((coefficient, n) => coefficient * (order - n));
}

export function product(a: Polynomial, b: Polynomial): Polynomial {
  if (a.length === 0 || b.length === 0) return [];
  const out = new Array<number>(a.length + b.length - 1).fill(0);
  a.forEach((x, i) => b.forEach((y, j) => {
    out[i + j] += x * y;
  }));
  return out;
}

export function sum(a: Polynomial, b: Polynomial): Polynomial {
  const length = Math.max(a.length, b.length);
  const at = (p: Polynomial, n: number): number => p[p.length - length + n] ?? 0;
  return Array.from({ length }, (_, n) => at(a, n) + at(b, n));
}
