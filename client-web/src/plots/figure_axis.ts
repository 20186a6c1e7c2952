// Axes of a figure: from values to pixels, and where ticks stand.

import { roundStep } from "./range";

export interface AxisSpec {
  readonly label: string;
  readonly scale: "linear" | "log";
  /** Least and greatest value on show; above 0 on a log scale. */
  readonly range: readonly [number, number];
  /** Text of a tick; digits as needed when left out. */
  readonly text?: (value: number) => string;
  /** Distance of ticks on a linear scale; round numbers when left out. */
  readonly step?: number;
}

export interface Tick {
  readonly value: number;
  /** Nothing: a line without a number. */
  readonly text: string | undefined;
}

/** Pixels of room that a tick's number needs, along x and along y. */
const ROOM = { x: 56, y: 30 };

export class AxisMap {
  readonly #spec: AxisSpec;
  readonly #from_px: number;
  readonly #to_px: number;

  /** The range runs from `from_px` to `to_px`. */
  constructor(spec: AxisSpec, from_px: number, to_px: number) {
    this.#spec = spec;
    this.#from_px = from_px;
    this.#to_px = to_px;
  }

  toPixels(value: number): number {
    return this.#from_px + this.#share(value) * (this.#to_px - this.#from_px);
  }

  toValue(pixels: number): number {
    const share = (pixels - this.#from_px) / (this.#to_px - this.#from_px);
    const [low, high] = this.#spec.range;
    return this.#spec.scale === "log" ? low * (high / low) ** share : low + share * (high - low);
  }

  ticks(direction: "x" | "y"): Tick[] {
    const most = Math.max(Math.abs(this.#to_px - this.#from_px) / ROOM[direction], 1);
    return this.#spec.scale === "log" ? decades(this.#spec, most) : evenTicks(this.#spec, most);
  }

  #share(value: number): number {
    const [low, high] = this.#spec.range;
    if (this.#spec.scale === "log") return Math.log(value / low) / Math.log(high / low);
    return (value - low) / (high - low);
  }
}

export function evenTicks({ range: [low, high], step: wanted, text }: AxisSpec, most: number): Tick[] {
  const step = wanted ?? roundStep((high - low) / most);
  const places = Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);
  const ticks: Tick[] = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n += 1) {
    const value = n * step;
    ticks.push({ value, text: text?.(value) ?? plainTick(value, places) });
  }
  return ticks;
}

/** Numbers at the decades, thinned out where they are many; lines between them where there is room. */
export function decades({ range: [low, high], text }: AxisSpec, most: number): Tick[] {
  const [first, last] = [Math.floor(Math.log10(low) + 1e-9), Math.ceil(Math.log10(high) - 1e-9)];
  const every = Math.max(Math.ceil((last - first) / most), 1);
  const ticks: Tick[] = [];
  for (let power = first; power <= last; power += 1) {
    for (const factor of every === 1 ? [1, 2, 3, 4, 5, 6, 7, 8, 9] : [1]) {
      const value = factor * 10 ** power;
      if (value < low * (1 - 1e-9) || high * (1 + 1e-9) < value) continue;
      const named = factor === 1 && (power - first) % every === 0;
      ticks.push({ value, text: named ? (text?.(value) ?? powerTick(value, power)) : undefined });
    }
  }
  return ticks;
}

function plainTick(value: number, places: number): string {
  const text = value.toFixed(Math.min(places, 10));
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

function powerTick(value: number, power: number): string {
  if (-3 <= power && power <= 3) return String(Number(value.toPrecision(3)));
  const digits = Array.from(String(Math.abs(power)), (digit) => RAISED[Number(digit)]).join("");
  return `10${power < 0 ? "⁻" : ""}${digits}`;
}

/**
 * Ranges of two linear axes widened so that one unit is as long on either, `width` by `height` pixels: a circle is
 * round then.
 */
export function equalRanges(
  x: readonly [number, number],
  y: readonly [number, number],
  width: number,
  height: number,
): { x: [number, number]; y: [number, number] } {
  const perPixel = Math.max((x[1] - x[0]) / width, (y[1] - y[0]) / height);
  const about = (range: readonly [number, number], pixels: number): [number, number] => {
    const middle = (range[0] + range[1]) / 2;
    return [middle - (perPixel * pixels) / 2, middle + (perPixel * pixels) / 2];
  };
  return { x: about(x, width), y: about(y, height) };
}
