// A strip chart: a stretch of time from left to right, curves over it, and a cursor. Its grid and axes are uPlot's; the
// curves are drawn from the arrays that they come in, so that drawing on and on takes no memory.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { AutoRange } from "./range";
import { TICKS_S, timeAxis, valueText } from "./time_axis";

export interface Curve {
  readonly label: string;
  /** A CSS custom property that holds the colour. */
  readonly colour: string;
  readonly width?: number;
}

export interface StripOptions {
  readonly curves: readonly Curve[];
  /** Height of the smallest range worth showing, in the plot's unit. */
  readonly least: number;
}

/** Points of the curves: times, and as many values per curve; what is not a number is a gap. */
export interface StripPoints {
  readonly time_s: Float64Array;
  readonly curves: readonly Float64Array[];
  readonly count: number;
  /** Of all values; the least is above the greatest where there are none. */
  readonly least: number;
  readonly greatest: number;
}

/** What is shown: times are those of the points. `clock`: how the axis writes them. */
export interface StripFrame {
  readonly from_s: number;
  readonly to_s: number;
  readonly clock: "session" | "before now";
}

const AXIS_FONT = "11px system-ui, sans-serif";
/** Room for numbers such as −12.5 at the left, px. */
const LEFT_AXIS = 44;
const BOTTOM_AXIS = 22;
const DOT_PX = 3.5;
/** Fewer pixels than this from sample to sample, and a dot on each would hide the curve. */
const DOTS_APART_PX = 9;
const LEAST_COLUMNS = 40;

export class StripChart {
  readonly #host: HTMLElement;
  readonly #options: StripOptions;
  readonly #range: AutoRange;
  #plot: uPlot;
  #points: StripPoints | undefined;
  #frame: StripFrame = { from_s: -1, to_s: 0, clock: "before now" };
  #cursor_s: number | undefined;
  #marks: readonly (number | undefined)[] = [];
  #colours: string[] = [];
  #cursorColour = "";
  readonly #x = { min: -1, max: 0 };
  readonly #y = { min: 0, max: 1 };

  constructor(host: HTMLElement, options: StripOptions) {
    this.#host = host;
    this.#options = options;
    this.#range = new AutoRange(options.least);
    this.#plot = this.#create();
  }

  /** Pixels along which data is drawn: more columns than this cannot be seen. */
  get columns(): number {
    return Math.max(Math.round(this.#plot.bbox.width / devicePixelRatio), LEAST_COLUMNS);
  }

  /** Where curves are drawn, in CSS pixels from the host's left edge. */
  get left_px(): number {
    return this.#plot.bbox.left / devicePixelRatio;
  }

  get width_px(): number {
    return Math.max(this.#plot.bbox.width / devicePixelRatio, 1);
  }

  /** What is drawn, grid and axes and all, for a picture. */
  get canvas(): HTMLCanvasElement {
    return this.#plot.ctx.canvas;
  }

  /** Draws points, which stay the caller's and are not read later than the next call. */
  draw(points: StripPoints, frame: StripFrame): void {
    this.#points = points;
    this.#frame = frame;
    const [low, high] = frame.clock === "session"
      ? this.#range.settle(points.least, points.greatest)
      : this.#range.update(points.least, points.greatest);
    this.#x.min = frame.from_s;
    this.#x.max = frame.to_s;
    this.#y.min = low;
    this.#y.max = high;
    this.#plot.batch(this.#rescale);
  }

  /** Puts a cursor at a time, with a mark on each curve that has a value there; nothing takes it away. */
  point(cursor_s: number | undefined, marks: readonly (number | undefined)[]): void {
    this.#cursor_s = cursor_s;
    this.#marks = marks;
  }

  resize(width: number, height: number): void {
    this.#plot.setSize({ width, height });
  }

  /** Another theme: the canvas does not follow CSS by itself. */
  recolour(): void {
    this.#plot.destroy();
    this.#plot = this.#create();
    this.#plot.batch(this.#rescale);
  }

  dispose(): void {
    this.#plot.destroy();
  }

  readonly #rescale = (): void => {
    this.#plot.setScale("x", this.#x);
    this.#plot.setScale("y", this.#y);
    // The same scales as before, and other points: uPlot would see no reason to draw.
    this.#plot.redraw(false, false);
  };

  #create(): uPlot {
    const style = getComputedStyle(this.#host);
    const colour = (property: string): string => style.getPropertyValue(property).trim();
    this.#colours = this.#options.curves.map(({ colour: property }) => colour(property));
    this.#cursorColour = colour("--text-faint");
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
      cursor: { show: false },
      scales: {
        x: { time: false, auto: false, range: () => [this.#x.min, this.#x.max] },
        y: { auto: false, range: () => [this.#y.min, this.#y.max] },
      },
      axes: [
        {
          ...axis, size: BOTTOM_AXIS, gap: 3, space: 46, incrs: TICKS_S,
          values: (_, splits) => timeAxis(splits, this.#frame.clock, this.#frame.to_s - this.#frame.from_s),
        },
        { ...axis, size: LEFT_AXIS, gap: 4, space: 24, values: (_, splits) => splits.map(valueText) },
      ],
      series: [{}],
      hooks: { draw: [this.#onDraw] },
    }, [[0, 1]], this.#host);
  }

  readonly #onDraw = (plot: uPlot): void => {
    const points = this.#points;
    if (points === undefined) return;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineJoin = "round";
    for (const [n, { width }] of this.#options.curves.entries()) this.#stroke(ctx, bbox, points, n, width ?? 1.5);
    this.#drawCursor(ctx, bbox);
    ctx.restore();
  };

  #stroke(ctx: CanvasRenderingContext2D, bbox: uPlot.BBox, points: StripPoints, curve: number, width: number): void {
    const values = points.curves[curve];
    const perSecond = bbox.width / (this.#x.max - this.#x.min);
    const perUnit = bbox.height / (this.#y.max - this.#y.min);
    const dots = DOTS_APART_PX * devicePixelRatio * points.count < bbox.width;
    const bottom = bbox.top + bbox.height;
    let isDown = false;
    ctx.strokeStyle = this.#colours[curve];
    ctx.fillStyle = this.#colours[curve];
    ctx.lineWidth = width * devicePixelRatio;
    ctx.beginPath();
    for (let n = 0; n < points.count; n += 1) {
      const value = values[n];
      if (Number.isNaN(value)) {
        isDown = false;
        continue;
      }
      const x = bbox.left + (points.time_s[n] - this.#x.min) * perSecond;
      const y = bottom - (value - this.#y.min) * perUnit;
      if (isDown) ctx.lineTo(x, y);
      else ctx.moveTo(x, y);
      if (dots) ctx.fillRect(x - width * devicePixelRatio, y - width * devicePixelRatio, 2 * width * devicePixelRatio, 2 * width * devicePixelRatio);
      isDown = true;
    }
    ctx.stroke();
  }

  #drawCursor(ctx: CanvasRenderingContext2D, bbox: uPlot.BBox): void {
    if (this.#cursor_s === undefined) return;
    const x = bbox.left + ((this.#cursor_s - this.#x.min) * bbox.width) / (this.#x.max - this.#x.min);
    ctx.strokeStyle = this.#cursorColour;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash(DASH);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.setLineDash(SOLID);
    for (const [n, value] of this.#marks.entries()) {
      if (value === undefined) continue;
      const y = bbox.top + bbox.height - ((value - this.#y.min) * bbox.height) / (this.#y.max - this.#y.min);
      ctx.fillStyle = this.#colours[n];
      ctx.beginPath();
      ctx.arc(x, y, DOT_PX * devicePixelRatio, 0, 2 * Math.PI);
      ctx.fill();
    }
  }
}

const DASH = [4, 3];
const SOLID: number[] = [];
