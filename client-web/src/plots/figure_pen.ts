// The pen that draws a figure: its grid, its lines, its marks.

import type { Band, Circle, Colour, Line, Mark, Rule } from "./figure_marks";
import type { AxisMap } from "./figure_axis";

/** Where the axes run, pixels. */
export interface Frame {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/** From a mark to its text, pixels. */
const TEXT_GAP = 8;

/** Draws one picture: frame, axes and colours are settled. */
export class Pen {
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
