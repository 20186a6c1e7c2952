// From text to a checked type, once.

import * as v from "valibot";
import { DecodeError } from "./header";

export function decodeJson<S extends v.GenericSchema>(schema: S, text: string): v.InferOutput<S> {
  let json: unknown;
  try {
    json = JSON.parse(text);
  } catch {
    throw new DecodeError(`not JSON: ${text.slice(0, 80)}`);
  }
  const result = v.safeParse(schema, json);
  if (result.success) return result.output;
  const issue = result.issues[0];
  throw new DecodeError(`${v.getDotPath(issue) ?? "message"}: ${issue.message}`);
}
