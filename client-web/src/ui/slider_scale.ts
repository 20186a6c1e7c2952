// Where a value stands on its slider, 0 … 1, and back.

export interface SliderScale {
  toShare(value: number): number;
  /** Rounded to two digits that matter, so that a slider never gives 0.04999. */
  toValue(share: number): number;
}

/** Even steps from 0 to `greatest`. */
export function linear(greatest: number): SliderScale {
  return power(greatest, 1);
}

/** From 0 to `greatest`, finer near 0: a share s stands for `greatest` · s^`exponent`. */
export function power(greatest: number, exponent: number): SliderScale {
  return {
    toShare: (value) => clamp(value / greatest) ** (1 / exponent),
    toValue: (share) => rounded(greatest * clamp(share) ** exponent),
  };
}

/** 0 at the left end, then decades from `least` to `greatest`. */
export function decades(least: number, greatest: number): SliderScale {
  const span = Math.log(greatest / least);
  const zero = 0.06;
  return {
    toShare: (value) => (value < least / 2 ? 0 : zero + (1 - zero) * clamp(Math.log(value / least) / span)),
    toValue: (share) => (share < zero / 2 ? 0 : rounded(least * Math.exp(span * clamp((share - zero) / (1 - zero))))),
  };
}

const clamp = (share: number): number => Math.min(Math.max(share, 0), 1);
const rounded = (value: number): number => Number(value.toPrecision(2));
