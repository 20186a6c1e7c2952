// What hands do to plots: a wheel zooms, a drag moves, two fingers do both, keys all of it.

import { plotCursor, plotWindow, view } from "./plot_view";

/** Where curves are, in CSS pixels of the element. */
export interface Area {
  readonly left_px: number;
  readonly width_px: number;
}

/** Zoom per pixel of a wheel, as an exponent; a pinch on a touch pad comes as a wheel with much smaller steps. */
const PER_PIXEL = 0.0016;
const PER_PINCHED_PIXEL = 0.01;
/** A wheel that counts lines, in pixels. */
const LINE_PX = 16;
/** A press that moves less is none to move the plot with. */
const SLACK_PX = 4;
const KEY_ZOOM = 1.3;
const KEY_PAN = 0.1;
const FINE_STEPS = 200;

/** Listens on a plot; returns what ends that. */
export function followHands(plot: HTMLElement, areaOf: () => Area): () => void {
  const pressed = new Map<number, number>();
  let began_px = 0;
  let isMoving = false;

  const placeOf = (event: MouseEvent): number => event.clientX - plot.getBoundingClientRect().left;
  const shareAt = (x_px: number): number => (x_px - areaOf().left_px) / areaOf().width_px;
  const pointAt = (x_px: number): void => {
    const share = shareAt(x_px);
    plotCursor.value = 0 <= share && share <= 1 ? share : undefined;
  };
  const spread = (): number => {
    const [a = 0, b = 0] = pressed.values();
    return Math.max(Math.abs(a - b), 1);
  };

  const onDown = (event: PointerEvent): void => {
    if (event.pointerType === "mouse" && event.button !== 0) return;
    pressed.set(event.pointerId, placeOf(event));
    plot.setPointerCapture(event.pointerId);
    began_px = placeOf(event);
    isMoving = false;
    pointAt(began_px);
  };
  const onMove = (event: PointerEvent): void => {
    const x_px = placeOf(event);
    const before_px = pressed.get(event.pointerId);
    if (before_px === undefined) {
      pointAt(x_px);
      return;
    }
    if (pressed.size === 2) {
      const before = spread();
      pressed.set(event.pointerId, x_px);
      const [a = 0, b = 0] = pressed.values();
      view.zoom(before / spread(), shareAt((a + b) / 2));
      isMoving = true;
      return;
    }
    isMoving ||= SLACK_PX < Math.abs(x_px - began_px);
    if (!isMoving) return;
    pressed.set(event.pointerId, x_px);
    view.pan((before_px - x_px) / areaOf().width_px);
    pointAt(x_px);
  };
  const onUp = (event: PointerEvent): void => {
    pressed.delete(event.pointerId);
  };
  const onLeave = (event: PointerEvent): void => {
    // A finger leaves with every touch: where it pointed stays.
    if (event.pointerType === "mouse" && pressed.size === 0) plotCursor.value = undefined;
  };
  const onWheel = (event: WheelEvent): void => {
    event.preventDefault();
    const unit_px = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : LINE_PX;
    const sideways = event.shiftKey && event.deltaX === 0 ? event.deltaY : event.deltaX;
    if (event.shiftKey || Math.abs(event.deltaY) < Math.abs(event.deltaX)) view.pan((sideways * unit_px) / areaOf().width_px);
    else view.zoom(Math.exp(event.deltaY * unit_px * (event.ctrlKey ? PER_PINCHED_PIXEL : PER_PIXEL)), shareAt(placeOf(event)));
  };

  const end = new AbortController();
  const { signal } = end;
  plot.addEventListener("pointerdown", onDown, { signal });
  plot.addEventListener("pointermove", onMove, { signal });
  plot.addEventListener("pointerup", onUp, { signal });
  plot.addEventListener("pointercancel", onUp, { signal });
  plot.addEventListener("pointerleave", onLeave, { signal });
  plot.addEventListener("dblclick", view.startOver, { signal });
  plot.addEventListener("wheel", onWheel, { signal, passive: false });
  return () => end.abort();
}

/** What the keys do, in the words of the page's help. */
export const KEYS = "left and right arrow look earlier and later, with shift they move the cursor, page up and down by a whole width, " +
  "plus and minus zoom, space pauses and goes on, home goes to the oldest sample, end to now, zero starts over";

/** Takes a key pressed on the plots; returns whether it was one of theirs. */
export function takeKey({ key, shiftKey, ctrlKey, altKey, metaKey }: KeyboardEvent): boolean {
  if (ctrlKey || altKey || metaKey) return false;
  const act = shiftKey ? (FINE_KEYS[key] ?? PLAIN_KEYS[key]) : PLAIN_KEYS[key];
  act?.();
  return act !== undefined;
}

const FINE_KEYS: Record<string, (() => void) | undefined> = {
  ArrowLeft: () => view.moveCursor(-1 / FINE_STEPS),
  ArrowRight: () => view.moveCursor(1 / FINE_STEPS),
};

const PLAIN_KEYS: Record<string, (() => void) | undefined> = {
  ArrowLeft: () => view.pan(-KEY_PAN),
  ArrowRight: () => view.pan(KEY_PAN),
  PageUp: () => view.pan(-1),
  PageDown: () => view.pan(1),
  "+": () => view.zoom(1 / KEY_ZOOM),
  "=": () => view.zoom(1 / KEY_ZOOM),
  "-": () => view.zoom(KEY_ZOOM),
  " ": () => (plotWindow.peek().held_s === undefined ? view.pause() : view.goOn()),
  Home: () => view.toOldest(),
  End: () => view.goOn(),
  "0": () => view.startOver(),
  Escape: () => { plotCursor.value = undefined; },
};
