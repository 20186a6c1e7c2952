// The texts by which a page holds a tool, on a socket of the hand's own: what is asked, and what the server answers.
// A grant, parameters and clay go on to the module as they came; here only what the page itself needs of them is read.

import * as v from "valibot";
import { decodeJson } from "./json";

/** What the pointer is, for the server and for people to read. */
export interface DeviceDescription {
  readonly name: string;
  readonly axes: 2 | 3;
  readonly force_n: number;
  readonly rate_hz: number;
  readonly measures_force: boolean;
}

export type HandQuestion =
  | { readonly type: "join"; readonly operator: string; readonly device: DeviceDescription }
  | { readonly type: "parameters" }
  | { readonly type: "snapshot"; readonly epoch: number }
  | { readonly type: "leave" };

/** A lease, as far as the page reads it. */
export interface Grant {
  readonly tool: number;
  readonly node: string;
  readonly lease_s: number;
  /** 64 bytes: the handle's, then the server's. */
  readonly keys: Uint8Array<ArrayBuffer>;
  /** The whole of it, JSON. */
  readonly json: string;
}

export interface Refusal {
  /** For programs: `no_free_tool`, `stopped`, `reserved` and others; a newer server may know more. */
  readonly code: string;
  readonly reason: string;
  readonly holder: string | undefined;
}

export type HandAnswer =
  | { readonly type: "granted"; readonly grant: Grant }
  | { readonly type: "refused"; readonly refusal: Refusal }
  | { readonly type: "parameters"; readonly json: string }
  /** As many messages of bricks follow. */
  | { readonly type: "snapshot"; readonly clay: string; readonly messages: number }
  | { readonly type: "left" }
  /** The lease has ended, for a reason of the server's. */
  | { readonly type: "farewell"; readonly reason: string }
  /** A question was not understood, or not allowed. */
  | { readonly type: "problem"; readonly detail: string }
  /** What any stream says, and what a newer server adds. */
  | { readonly type: "other" };

const KEYS_HEX = /^[0-9a-f]{128}$/i;
const count = v.pipe(v.number(), v.integer(), v.minValue(0));

const granted = v.object({
  type: v.literal("granted"),
  keys: v.pipe(v.string(), v.regex(KEYS_HEX, "wanted 128 hexadecimal digits")),
  granted: v.looseObject({ lease: count, tool: count, node: v.string(), lease_s: v.number() }),
});
const refused = v.object({
  type: v.literal("refused"),
  code: v.string(),
  reason: v.string(),
  holder: v.optional(v.nullable(v.string())),
});
const parameters = v.object({ type: v.literal("parameters"), parameters: v.looseObject({ revision: count }) });
const snapshot = v.object({
  type: v.literal("snapshot"),
  clay: v.looseObject({ epoch: count, revision: count }),
  messages: count,
});
const left = v.object({ type: v.literal("left") });
const farewell = v.object({ type: v.literal("farewell"), reason: v.string() });
const problem = v.object({ type: v.literal("problem"), problem: v.looseObject({ detail: v.string() }) });

const known = v.variant("type", [granted, refused, parameters, snapshot, left, farewell, problem]);
const KNOWN: readonly string[] = known.options.map((option) => option.entries.type.literal);
const typed = v.looseObject({ type: v.string() });

/** Throws {@link DecodeError} where a text is none, or not what its type says. */
export function decodeHandAnswer(text: string): HandAnswer {
  const { type } = decodeJson(typed, text);
  if (!KNOWN.includes(type)) return { type: "other" };
  const answer = decodeJson(known, text);
  switch (answer.type) {
    case "granted": {
      const { tool, node, lease_s } = answer.granted;
      return { type: "granted", grant: { tool, node, lease_s, keys: bytesOf(answer.keys), json: JSON.stringify(answer.granted) } };
    }
    case "refused": {
      const { code, reason, holder } = answer;
      return { type: "refused", refusal: { code, reason, holder: holder ?? undefined } };
    }
    case "parameters": return { type: "parameters", json: JSON.stringify(answer.parameters) };
    case "snapshot": return { type: "snapshot", clay: JSON.stringify(answer.clay), messages: answer.messages };
    case "farewell": return { type: "farewell", reason: answer.reason };
    case "problem": return { type: "problem", detail: answer.problem.detail };
    case "left": return { type: "left" };
  }
}

export const encodeHandQuestion = (question: HandQuestion): string => JSON.stringify(question);

/** The hand's socket hears of nothing else: what comes is an answer, a frame or clay that was asked for. */
export const HAND_SUBSCRIPTION = JSON.stringify({ type: "subscribe", telemetry: "off", bricks: "off" });

function bytesOf(hex: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
}
