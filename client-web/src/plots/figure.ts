// A figure as in a lecture: curves that need not be functions, equal axes where angles matter, and what matters marked
// in it. It is drawn anew whenever its content changes; it does not move by itself.

import { AxisMap, type AxisSpec, equalRanges } from "./figure_axis";
import type { Band, Circle, Line, Mark, Rule } from "./figure_marks";
import { Pen } from "./figure_pen";

export type { Line, Mark } from "./figure_marks";

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

const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'DejaVu Sans', sans-serif";
const MARGIN = { left: 58, top: 10, right: 22, bottom: 42 };

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

  /** Where 0 and 1 lie, in pixels from the upper left corner, for programs that read the picture. */
  #tellAxes(x: AxisMap, y: AxisMap): void {
    this.#host.dataset["zeroPx"] = `${x.toPixels(0)} ${y.toPixels(0)}`;
    this.#host.dataset["onePx"] = `${x.toPixels(1)} ${y.toPixels(1)}`;
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
    this.#tellAxes(x, y);

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
