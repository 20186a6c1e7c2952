// What the module that reads recordings says of one, and of a moment of it (crates/reel/src/words.rs). Moments are
// seconds since the recording began.

import * as v from "valibot";
import { decodeJson } from "./json";
import { clayShape, type ClayShape, scheme, type Scheme, toolShape, type ToolShape, type Vector, vector } from "./session";

/** Why a recording does not lead to the clay until its next state. */
export type Why =
  | { readonly kind: "dropped" | "missing"; readonly ticks: number }
  | { readonly kind: "elsewhere" }
  | { readonly kind: "broken"; readonly why: string };

export interface Mark {
  readonly at_s: number;
  readonly level: "info" | "warning" | "error";
  readonly text: string;
}

export interface Gap {
  readonly from_s: number;
  /** Nothing: up to the end. */
  readonly to_s: number | null;
  readonly why: Why;
}

/** What is known of a recording so far. */
export interface FilmFacts {
  /** As ROS 2 spells it. */
  readonly session: string;
  readonly lasts_s: number;
  readonly ticks: number;
  readonly dropped: number;
  readonly bytes: number;
  /** Hashes of the clay that were compared with what the history makes. */
  readonly hashes: number;
  /** The last of them, as the recording tells it. */
  readonly hash: string | null;
  /** When the first of them differed. */
  readonly differs_s: number | null;
  readonly end: "ahead" | "whole" | "cut_off";
  readonly reason: string | null;
  /** Whether each tool was ever shown. */
  readonly tools: readonly boolean[];
  /** Those that were not told before. */
  readonly marks: readonly Mark[];
  readonly gaps: readonly Gap[];
  /** How long the columns are whose extremes are known. */
  readonly column_s: number;
  readonly keyframe_s: number;
  readonly keyframe_bytes: number;
}

export interface FilmTool {
  readonly tool: number;
  /** When it was shown last. */
  readonly told_s: number | null;
  readonly holder: string | null;
  readonly is_connected: boolean;
  /** By channel, as in telemetry; nothing where it was not told. */
  readonly values: readonly (number | null)[];
}

export interface FilmSettings {
  readonly revision: number;
  readonly scheme: Scheme;
  readonly shape: ClayShape;
  readonly tool: ToolShape;
  readonly position_ratio: number;
  readonly home_m: Vector;
  readonly tick_s: number;
  readonly is_paused: boolean;
}

export interface FilmMoment {
  readonly at_s: number;
  readonly tick: number | null;
  /** Whether what was cut could not be kept. */
  readonly is_full: boolean;
  readonly clay: { readonly hash: string; readonly remaining_units: number } | null;
  readonly lost: Why | null;
  readonly tools: readonly FilmTool[];
  readonly settings: FilmSettings | null;
}

const why: v.GenericSchema<unknown, Why> = v.variant("kind", [
  v.object({ kind: v.picklist(["dropped", "missing"]), ticks: v.number() }),
  v.object({ kind: v.literal("elsewhere") }),
  v.object({ kind: v.literal("broken"), why: v.string() }),
]);

const factsSchema: v.GenericSchema<unknown, FilmFacts> = v.object({
  session: v.string(),
  lasts_s: v.number(),
  ticks: v.number(),
  dropped: v.number(),
  bytes: v.number(),
  hashes: v.number(),
  hash: v.nullable(v.string()),
  differs_s: v.nullable(v.number()),
  end: v.picklist(["ahead", "whole", "cut_off"]),
  reason: v.nullable(v.string()),
  tools: v.array(v.boolean()),
  marks: v.array(v.object({ at_s: v.number(), level: v.picklist(["info", "warning", "error"]), text: v.string() })),
  gaps: v.array(v.object({ from_s: v.number(), to_s: v.nullable(v.number()), why })),
  column_s: v.number(),
  keyframe_s: v.number(),
  keyframe_bytes: v.number(),
});

const momentSchema: v.GenericSchema<unknown, FilmMoment> = v.object({
  at_s: v.number(),
  tick: v.nullable(v.number()),
  is_full: v.boolean(),
  clay: v.nullable(v.object({ hash: v.string(), remaining_units: v.number() })),
  lost: v.nullable(why),
  tools: v.array(v.object({
    tool: v.number(),
    told_s: v.nullable(v.number()),
    holder: v.nullable(v.string()),
    is_connected: v.boolean(),
    values: v.array(v.nullable(v.number())),
  })),
  settings: v.nullable(v.object({
    revision: v.number(),
    scheme,
    shape: clayShape,
    tool: toolShape,
    position_ratio: v.number(),
    home_m: vector,
    tick_s: v.number(),
    is_paused: v.boolean(),
  })),
});

export const decodeFilmFacts = (text: string): FilmFacts => decodeJson(factsSchema, text);
export const decodeFilmMoment = (text: string): FilmMoment => decodeJson(momentSchema, text);
