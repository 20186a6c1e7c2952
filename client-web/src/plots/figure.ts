// A figure as in a lecture: curves that need not be functions, equal axes where angles matter, and what matters marked in it.
// It is drawn anew whenever its content changes; it does not move by itself.

import { AxisMap, type AxisSpec, equalRanges } from "./figure_axis";

/** A CSS custom property that holds a colour, registered as one in the style sheet. */
type Colour = string;

export interface Line {
  readonly x: readonly number[];
  /** A value that is not finite breaks the line. */
  readonly y: readonly number[];
  readonly colour: Colour;
  readonly width?: number;
  readonly dash?: readonly number[];
  /** 0 … 1. */
  readonly opacity?: number;
  /** Arrows along the line show which way it runs: every so many points. */
  readonly arrowsAt?: readonly number[];
}

export interface Mark {
  readonly x: number;
  readonly y: number;
  readonly colour: Colour;
  readonly shape: "dot" | "ring" | "cross";
  readonly text?: string;
  /** Where the text stands. */
  readonly side?: "left" | "right" | "above" | "below";
}

/** A line across the whole figure. */
export interface Rule {
  readonly along: "x" | "y";
  readonly at: number;
  readonly colour: Colour;
  readonly dash?: readonly number[];
  readonly text?: string;
}

/** A stretch of x. */
export interface Band {
  readonly from: number;
  readonly to: number;
  readonly colour: Colour;
  readonly text?: string;
}

export interface Circle {
  readonly x: number;
  readonly y: number;
  readonly radius: number;
  readonly colour: Colour;
  readonly dash?: readonly number[];
}

export interface FigureContent {
  readonly x: AxisSpec;
  readonly y: AxisSpec;
  /** One unit is as long on either axis. */
  readonly equal?: boolean;
  readonly bands?: readonly Band[];
  readonly circles?: readonly Circle[];
  readonly rules?: readonly Rule[];
  readonly lines: readonly Line[];
  readonly marks?: readonly Mark[];
}

export interface FigurePoint {
  readonly x: number;
  readonly y: number;
}

interface Frame {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'DejaVu Sans', sans-serif";
const MARGIN = { left: 58, top: 10, right: 22, bottom: 42 };
const TEXT_GAP = 8;

export class Figure {
  readonly #host: HTMLElement;
  readonly #canvas = document.createElement("canvas");
  readonly #context: CanvasRenderingContext2D;
  #content: FigureContent | undefined;
  #x: AxisMap | undefined;
  #y: AxisMap | undefined;
  #width = 0;
  #height = 0;

  /** Told where the mouse is, in the axes' units; nothing when it has left. */
  constructor(host: HTMLElement, onPointer?: (at: FigurePoint | undefined) => void) {
    const context = this.#canvas.getContext("2d");
    if (context === null) throw new Error("this browser draws no canvas");
    this.#host = host;
    this.#context = context;
    this.#canvas.style.display = "block";
    host.append(this.#canvas);
    if (onPointer === undefined) return;
    this.#canvas.addEventListener("pointermove", ({ offsetX, offsetY }) => {
      if (this.#x !== undefined && this.#y !== undefined) onPointer({ x: this.#x.toValue(offsetX), y: this.#y.toValue(offsetY) });
    });
    this.#canvas.addEventListener("pointerleave", () => onPointer(undefined));
  }

  show(content: FigureContent): void {
    this.#content = content;
    this.#draw();
  }

  resize(width: number, height: number): void {
    if (width === this.#width && height === this.#height) return;
    this.#width = width;
    this.#height = height;
    this.#draw();
  }

  /** Another theme. */
  recolour(): void {
    this.#draw();
  }

  dispose(): void {
    this.#canvas.remove();
  }

  #draw(): void {
    const content = this.#content;
    if (content === undefined || this.#width < 100 || this.#height < 80) return;
    this.#canvas.width = Math.round(this.#width * devicePixelRatio);
    this.#canvas.height = Math.round(this.#height * devicePixelRatio);
    this.#canvas.style.width = `${this.#width}px`;
    this.#canvas.style.height = `${this.#height}px`;
    const context = this.#context;
    context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    context.clearRect(0, 0, this.#width, this.#height);
    context.font = FONT;
    context.lineJoin = "round";

    const frame = { left: MARGIN.left, top: MARGIN.top, right: this.#width - MARGIN.right, bottom: this.#height - MARGIN.bottom };
    const ranges = content.equal === true
      ? equalRanges(content.x.range, content.y.range, frame.right - frame.left, frame.bottom - frame.top)
      : { x: content.x.range, y: content.y.range };
    const x = new AxisMap({ ...content.x, range: ranges.x }, frame.left, frame.right);
    const y = new AxisMap({ ...content.y, range: ranges.y }, frame.bottom, frame.top);
    [this.#x, this.#y] = [x, y];

    const pen = new Pen(context, frame, x, y, (name) => getComputedStyle(this.#host).getPropertyValue(name).trim());
    pen.grid(content.x.label, content.y.label);
    pen.clip(() => {
      for (const band of content.bands ?? []) pen.band(band);
      for (const circle of content.circles ?? []) pen.circle(circle);
      for (const rule of content.rules ?? []) pen.rule(rule);
      for (const line of content.lines) pen.line(line);
    });
    for (const mark of content.marks ?? []) pen.mark(mark);
  }
}

/** Draws one picture: frame, axes and colours are settled. */
class Pen {
  readonly #context: CanvasRenderingContext2D;
  readonly #frame: Frame;
  readonly #x: AxisMap;
  readonly #y: AxisMap;
  readonly #colour: (name: Colour) => string;

  constructor(context: CanvasRenderingContext2D, frame: Frame, x: AxisMap, y: AxisMap, colour: (name: Colour) => string) {
    this.#context = context;
    this.#frame = frame;
    this.#x = x;
    this.#y = y;
    this.#colour = colour;
  }

  grid(xLabel: string, yLabel: string): void {
    const context = this.#context;
    const { left, top, right, bottom } = this.#frame;
    context.lineWidth = 1;
    context.textBaseline = "middle";
    for (const { value, text } of this.#x.ticks("x")) {
      const at = Math.round(this.#x.toPixels(value)) + 0.5;
      this.#segment(at, top, at, bottom, text === undefined ? "--grid" : "--grid-strong");
      if (text !== undefined) this.#text(text, at, bottom + 12, "center");
    }
    for (const { value, text } of this.#y.ticks("y")) {
      const at = Math.round(this.#y.toPixels(value)) + 0.5;
      this.#segment(left, at, right, at, text === undefined ? "--grid" : "--grid-strong");
      if (text !== undefined) this.#text(text, left - 7, at, "right");
    }
    context.strokeStyle = this.#colour("--text-faint");
    context.lineWidth = 1;
    context.strokeRect(left + 0.5, top + 0.5, right - left, bottom - top);
    this.#text(xLabel, (left + right) / 2, bottom + 31, "center");
    context.save();
    context.translate(11, (top + bottom) / 2);
    context.rotate(-Math.PI / 2);
    this.#text(yLabel, 0, 0, "center");
    context.restore();
  }

  /** Nothing that `draw` does shows outside the frame. */
  clip(draw: () => void): void {
    const { left, top, right, bottom } = this.#frame;
    this.#context.save();
    this.#context.beginPath();
    this.#context.rect(left, top, right - left, bottom - top);
    this.#context.clip();
    draw();
    this.#context.restore();
  }

  band({ from, to, colour, text }: Band): void {
    const context = this.#context;
    const [a, b] = [this.#x.toPixels(from), this.#x.toPixels(to)];
    context.globalAlpha = 0.09;
    context.fillStyle = this.#colour(colour);
    context.fillRect(a, this.#frame.top, b - a, this.#frame.bottom - this.#frame.top);
    context.globalAlpha = 1;
    if (text !== undefined) this.#text(text, (a + b) / 2, this.#frame.top + 14, "center", "--text-soft");
  }

  circle({ x, y, radius, colour, dash }: Circle): void {
    const context = this.#context;
    context.beginPath();
    const across = Math.abs(this.#x.toPixels(x + radius) - this.#x.toPixels(x));
    context.arc(this.#x.toPixels(x), this.#y.toPixels(y), across, 0, 2 * Math.PI);
    this.#stroke(colour, 1, dash);
  }

  rule({ along, at, colour, dash, text }: Rule): void {
    const { left, top, right, bottom } = this.#frame;
    const context = this.#context;
    context.beginPath();
    const px = along === "x" ? this.#y.toPixels(at) : this.#x.toPixels(at);
    context.moveTo(along === "x" ? left : px, along === "x" ? px : top);
    context.lineTo(along === "x" ? right : px, along === "x" ? px : bottom);
    this.#stroke(colour, 1.25, dash);
    if (text === undefined) return;
    if (along === "x") this.#text(text, right - 6, px - 9, "right", colour);
    else this.#text(text, px + 5, top + 12, "left", colour);
  }

  line({ x, y, colour, width, dash, opacity, arrowsAt }: Line): void {
    const context = this.#context;
    context.beginPath();
    let down = false;
    for (let n = 0; n < x.length; n += 1) {
      const [px, py] = [bounded(this.#x.toPixels(x[n])), bounded(this.#y.toPixels(y[n]))];
      if (!Number.isFinite(px) || !Number.isFinite(py)) {
        down = false;
        continue;
      }
      if (down) context.lineTo(px, py);
      else context.moveTo(px, py);
      down = true;
    }
    context.globalAlpha = opacity ?? 1;
    this.#stroke(colour, width ?? 2, dash);
    for (const n of arrowsAt ?? []) if (0 < n && n < x.length) this.#arrow(x[n - 1], y[n - 1], x[n], y[n], colour);
    context.globalAlpha = 1;
  }

  mark({ x, y, colour, shape, text, side = "right" }: Mark): void {
    const [px, py] = [this.#x.toPixels(x), this.#y.toPixels(y)];
    const { left, top, right, bottom } = this.#frame;
    if (!(left - 1 <= px && px <= right + 1 && top - 1 <= py && py <= bottom + 1)) return;
    const context = this.#context;
    context.beginPath();
    if (shape === "cross") {
      for (const turn of [1, -1]) {
        context.moveTo(px - 6, py - 6 * turn);
        context.lineTo(px + 6, py + 6 * turn);
      }
      this.#stroke(colour, 2.5);
    } else {
      context.arc(px, py, shape === "dot" ? 4 : 5, 0, 2 * Math.PI);
      context.fillStyle = this.#colour(shape === "dot" ? colour : "--panel");
      context.fill();
      this.#stroke(shape === "dot" ? "--panel" : colour, shape === "dot" ? 1 : 2);
    }
    if (text !== undefined) this.#markText(text, px, py, side, colour);
  }

  #markText(text: string, px: number, py: number, side: NonNullable<Mark["side"]>, colour: Colour): void {
    const width = this.#context.measureText(text).width;
    // A text that would leave the figure stands on the other side.
    const flipped = side === "right" && this.#frame.right < px + TEXT_GAP + width ? "left"
      : side === "left" && px - TEXT_GAP - width < this.#frame.left ? "right" : side;
    const at = {
      left: [px - TEXT_GAP, py, "right"], right: [px + TEXT_GAP, py, "left"],
      above: [px, py - 15, "center"], below: [px, py + 16, "center"],
    } as const;
    const [x, y, align] = at[flipped];
    this.#text(text, x, y, align, colour);
  }

  #text(text: string, x: number, y: number, align: CanvasTextAlign, colour: Colour = "--text-soft"): void {
    const context = this.#context;
    context.textAlign = align;
    context.textBaseline = "middle";
    // A rim in the paper's colour, so that lines behind do not strike it through.
    context.strokeStyle = this.#colour("--panel");
    context.lineWidth = 4;
    context.setLineDash([]);
    context.strokeText(text, x, y);
    context.fillStyle = this.#colour(colour);
    context.fillText(text, x, y);
  }

  #arrow(x0: number, y0: number, x1: number, y1: number, colour: Colour): void {
    const [ax, ay] = [this.#x.toPixels(x0), this.#y.toPixels(y0)];
    const [bx, by] = [this.#x.toPixels(x1), this.#y.toPixels(y1)];
    const length = Math.hypot(bx - ax, by - ay);
    if (!(0 < length) || 1e4 < Math.abs(bx) + Math.abs(by)) return;
    const [ux, uy] = [(bx - ax) / length, (by - ay) / length];
    const context = this.#context;
    context.beginPath();
    context.moveTo(bx + 5 * ux, by + 5 * uy);
    context.lineTo(bx - 5 * ux - 5 * uy, by - 5 * uy + 5 * ux);
    context.lineTo(bx - 5 * ux + 5 * uy, by - 5 * uy - 5 * ux);
    context.closePath();
    context.fillStyle = this.#colour(colour);
    context.fill();
  }

  #segment(x0: number, y0: number, x1: number, y1: number, colour: Colour): void {
    this.#context.beginPath();
    this.#context.moveTo(x0, y0);
    this.#context.lineTo(x1, y1);
    this.#stroke(colour, 1);
  }

  #stroke(colour: Colour, width: number, dash: readonly number[] = []): void {
    this.#context.strokeStyle = this.#colour(colour);
    this.#context.lineWidth = width;
    this.#context.setLineDash([...dash]);
    this.#context.stroke();
    this.#context.setLineDash([]);
  }
}

/** A canvas takes no coordinates beyond some millions; what is that far out is out of sight in any case. */
function bounded(pixels: number): number {
  return Math.min(Math.max(pixels, -1e5), 1e5);
}
