// What crosses HTTP and the text messages of a stream, by the server's own description: `npm run types` writes the
// types from openapi.json. What comes in is checked all the same, in this folder; a check that lets something else
// through than its type says does not compile.

import type * as v from "valibot";
import type { components } from "../../generated/api";

export type Schemas = components["schemas"];

/** A check that lets through what the server describes as `Name`, and nothing else. */
export type Check<Name extends keyof Schemas> = v.GenericSchema<unknown, Schemas[Name]>;
