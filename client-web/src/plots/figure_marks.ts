// What a figure is made of.

/** A CSS custom property that holds a colour, registered as one in the style sheet. */
export type Colour = string;

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
