// What was cut in the present block, stroke by stroke: what undo takes back and a time line shows.

import * as v from "valibot";

/** A tool's cuts between two pauses of its hand. */
export interface Stroke {
  /** Counts the strokes of the session in the order in which they began. */
  readonly number: number;
  readonly tool: number;
  readonly operator: string;
  /** Its first and its last cut that removed clay, in the session's time. */
  readonly from_s: number;
  readonly to_s: number;
  readonly removed_volume_m3: number;
  readonly undone: boolean;
}

export interface Strokes {
  readonly strokes: readonly Stroke[];
  /** When the block was fresh, and now. */
  readonly from_s: number;
  readonly to_s: number;
}

const stroke = v.object({
  number: v.number(),
  tool: v.number(),
  operator: v.string(),
  from_s: v.number(),
  to_s: v.number(),
  removed_volume_m3: v.number(),
  undone: v.boolean(),
}) satisfies v.GenericSchema<unknown, Stroke>;

export const strokesSchema: v.GenericSchema<unknown, Strokes> = v.object({
  strokes: v.array(stroke),
  from_s: v.number(),
  to_s: v.number(),
});

/** Which strokes an undo means: the last one, of anybody or of one tool, or one and all that came after it. */
export type Undo = { readonly tool?: number } | { readonly since: number };

/** Which stroke a redo means: the one undone last, of anybody or of one tool. */
export interface Redo {
  readonly tool?: number;
}
