// A strip chart of the last seconds. Time runs from the past at the left to now at the right edge.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { AutoRange } from "./range";

export interface Curve {
  readonly label: string;
  /** A CSS custom property that holds the colour. */
  readonly colour: string;
  readonly width?: number;
}

export interface StripOptions {
  readonly curves: readonly Curve[];
  readonly span_s: number;
  /** Height of the smallest range worth showing, in the plot's unit. */
  readonly least: number;
  /** Told what is under the mouse: one value per curve, `undefined` when the mouse has left. */
  readonly onPoint: (values: readonly (number | null)[] | undefined, time_s: number) => void;
}

type Points = (number | null)[];

const AXIS_FONT = "11px system-ui, sans-serif";
/** Room for numbers such as −12.5 at the left, px. */
const LEFT_AXIS = 44;
const BOTTOM_AXIS = 22;

export class StripChart {
  readonly #host: HTMLElement;
  readonly #options: StripOptions;
  readonly #range: AutoRange;
  #plot: uPlot;
  #data: uPlot.AlignedData;
  #extent: [number, number] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];

  constructor(host: HTMLElement, options: StripOptions) {
    this.#host = host;
    this.#options = options;
    this.#range = new AutoRange(options.least);
    this.#data = [[], ...options.curves.map(() => [])];
    this.#plot = this.#create();
  }

  /** Pixels along which data is drawn: more columns than this cannot be seen. */
  get columns(): number {
    return Math.max(Math.round(this.#plot.bbox.width / devicePixelRatio), 40);
  }

  /** New points: seconds before now, and a list per curve. */
  update(times_s: readonly number[], curves: readonly Points[]): void {
    this.#data = [[...times_s], ...curves];
    this.#extent = extentOf(curves);
    this.#plot.setData(this.#data, false);
    this.#plot.setScale("x", { min: -this.#options.span_s, max: 0 });
  }

  resize(width: number, height: number): void {
    this.#plot.setSize({ width, height });
  }

  /** Another theme: the canvas does not follow CSS by itself. */
  recolour(): void {
    this.#plot.destroy();
    this.#plot = this.#create();
  }

  dispose(): void {
    this.#plot.destroy();
  }

  #create(): uPlot {
    const style = getComputedStyle(this.#host);
    const colour = (property: string): string => style.getPropertyValue(property).trim();
    const axis = {
      stroke: colour("--text-faint"),
      font: AXIS_FONT,
      grid: { stroke: colour("--grid"), width: 1 },
      ticks: { show: false },
    };
    const { width, height } = this.#host.getBoundingClientRect();
    return new uPlot({
      width: Math.max(width, 50),
      height: Math.max(height, 50),
      padding: [6, 14, 0, 0],
      legend: { show: false },
      cursor: { x: true, y: false, drag: { x: false, y: false }, points: { size: 6 } },
      scales: {
        x: { time: false, auto: false, range: [-this.#options.span_s, 0] },
        y: { auto: true, range: () => this.#range.update(...this.#extent) },
      },
      axes: [
        { ...axis, size: BOTTOM_AXIS, gap: 3, space: 44, values: (_, splits) => splits.map((s) => (s === 0 ? "now" : s === -this.#options.span_s ? "" : `${s} s`)) },
        { ...axis, size: LEFT_AXIS, gap: 4, space: 24 },
      ],
      series: [
        {},
        ...this.#options.curves.map(({ label, colour: property, width: stroke }) => ({
          label,
          stroke: colour(property),
          width: stroke ?? 1.5,
          points: { show: false },
        })),
      ],
      hooks: {
        setCursor: [(plot) => this.#onCursor(plot)],
      },
    }, this.#data, this.#host);
  }

  #onCursor(plot: uPlot): void {
    const at = plot.cursor.idx;
    if (at === null || at === undefined || (plot.cursor.left ?? -1) < 0) {
      this.#options.onPoint(undefined, 0);
      return;
    }
    const [times, ...curves] = this.#data;
    this.#options.onPoint(curves.map((points) => points[at] ?? null), times[at]);
  }
}

function extentOf(curves: readonly Points[]): [number, number] {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const points of curves) {
    for (const value of points) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  return [low, high];
}
