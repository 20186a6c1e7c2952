// The text messages of the WebSocket, and JSON answers of HTTP: from text to a checked type, and back.

import * as v from "valibot";
import type { Check, Schemas } from "./api";
import { decodeJson as decode } from "./json";
import { type LatencyTable, latencyTableSchema } from "./latency";
import * as theory from "./theory";
import { clayResetSchema, patchSchema, problemSchema, sessionEntrySchema, sessionSchema } from "./session";
import type { Problem, Session, SessionEntry } from "./session";
import { type Recording, recordingsSchema } from "./recording";
import { type Strokes, strokesSchema } from "./strokes";

/** What the server speaks; asked for when the socket is opened. */
export const SUBPROTOCOL = "teleclay.v1";

/** What whoever watches is told; what is for hands besides, operate.ts reads. */
export type ServerText =
  | Extract<Schemas["ServerText"], { type: "hello" | "event" | "problem" | "pong" }>
  | { readonly type: "state"; readonly session: Session };
export type ClientText = Schemas["ClientText"];
export type ServerEvent = Extract<ServerText, { type: "event" }>;

const serverText: v.GenericSchema<unknown, ServerText> = v.variant("type", [
  v.object({ type: v.literal("hello"), protocol: v.number(), session: v.string(), server_version: v.string() }),
  v.object({ type: v.literal("state"), session: sessionSchema }),
  v.object({ type: v.literal("event"), level: v.picklist(["info", "warning", "error"]), text: v.string(), time_s: v.number() }),
  v.object({ type: v.literal("problem"), problem: problemSchema }),
  v.object({ type: v.literal("pong"), nonce: v.number() }),
]);

const onOff = v.picklist(["on", "off"]);

const clientText: Check<"ClientText"> = v.variant("type", [
  v.object({ type: v.literal("subscribe"), telemetry: onOff, bricks: onOff }),
  v.object({ type: v.literal("patch"), session: patchSchema }),
  v.object({ type: v.literal("reset"), clay: clayResetSchema }),
  v.object({ type: v.literal("ping"), nonce: v.number() }),
]);

export const decodeServerText = (text: string): ServerText => decode(serverText, text);
export const decodeClientText = (text: string): ClientText => decode(clientText, text);
export const encodeText = (message: ServerText | ClientText): string => JSON.stringify(message);

export const decodeSession = (text: string): Session => decode(sessionSchema, text);
export const decodeSessions = (text: string): SessionEntry[] => decode(v.array(sessionEntrySchema), text);
export const decodeRecordings = (text: string): Recording[] => decode(recordingsSchema, text);
export const decodeStrokes = (text: string): Strokes => decode(strokesSchema, text);

export const decodeLoopAnswer = (text: string): theory.LoopAnswer => decode(theory.loopAnswerSchema, text);
export const decodeCuttingAnswer = (text: string): theory.CuttingAnswer => decode(theory.cuttingAnswerSchema, text);
export const decodeInverseAnswer = (text: string): theory.InverseAnswer => decode(theory.inverseAnswerSchema, text);
export const decodeJacobianAnswer = (text: string): theory.JacobianAnswer => decode(theory.jacobianAnswerSchema, text);
export const decodeWorkspaceAnswer = (text: string): theory.WorkspaceAnswer => decode(theory.workspaceAnswerSchema, text);

export const decodeLatencyTable = (text: string): LatencyTable => decode(latencyTableSchema, text);

/** The problem in an answer's body; nothing when the body is something else, such as a proxy's page. */
export function decodeProblem(text: string): Problem | undefined {
  try {
    return decode(problemSchema, text);
  } catch {
    return undefined;
  }
}
