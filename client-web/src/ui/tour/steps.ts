// What the tour of *Live* shows, and where its card stands.

export interface Step {
  /** A selector of what is pointed at; a step without it on the page is left out. */
  readonly target: string;
  readonly title: string;
  readonly text: string;
}

/** Read aloud they take less than a minute. */
export const STEPS: readonly Step[] = [
  { target: ".clay", title: "The clay", text: "It lies on the server and is drawn as it is cut. Drag to turn it, scroll to come closer." },
  { target: ".forces", title: "Forces", text: "How hard the hand pushes, what it feels, and what the clay does to the tool. Arrows show them in the picture." },
  { target: ".timeline", title: "Every stroke", text: "Strokes can be taken back and cut again. Along the line you see the clay as it was." },
  { target: ".plots", title: "The last five minutes", text: "Scroll to zoom, drag to look back, hold to read in peace. What you see can be saved." },
  { target: ".controls", title: "The line between hand and clay", text: "Add delay or loss, and choose the scheme that copes with it." },
  { target: "[data-testid='operate']", title: "Your turn", text: "Take a tool yourself: press here, then cut with the mouse, a pen or a finger." },
];

/** Words that a person reads in a minute, slowly. */
export const WORDS_A_MINUTE = 150;

export interface Box {
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
}

interface Size {
  readonly width: number;
  readonly height: number;
}

/** Between card and target, and around both, px. */
export const GAP_PX = 10;

/** Beside the target where there is room, else at the window's bottom; never beyond the window. */
export function placeOf(target: Box, card: Size, view: Size): { left: number; top: number } {
  const right = target.left + target.width;
  const bottom = target.top + target.height;
  const places = [
    { left: target.left, top: bottom + GAP_PX },
    { left: target.left, top: target.top - GAP_PX - card.height },
    { left: target.left - GAP_PX - card.width, top: target.top },
    { left: right + GAP_PX, top: target.top },
  ];
  const fits = ({ left, top }: { left: number; top: number }): boolean =>
    0 <= left && 0 <= top && left + card.width <= view.width && top + card.height <= view.height;
  const within = (at: number, size: number, room: number): number => Math.max(Math.min(at, room - size - GAP_PX), GAP_PX);
  const { left, top } = places.find(fits) ?? { left: target.left + GAP_PX, top: Math.min(bottom, view.height) - card.height - GAP_PX };
  return { left: within(left, card.width, view.width), top: within(top, card.height, view.height) };
}
