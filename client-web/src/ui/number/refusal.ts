// A refusal of the server's, told beside a field or in a sentence, in the unit that people see.

import { type OutOfRange, outOfRangeIn } from "../../protocol/problem";
import type { Problem } from "../../protocol/session";
import { outOfRange, type Unit } from "./typed";

/** What the server said of a field, in its own words, and the range in them, SI. */
export interface Refusal {
  readonly detail: string;
  readonly range: OutOfRange | undefined;
}

export const refusalOf = (detail: string): Refusal => ({ detail, range: outOfRangeIn(detail) });

/** The refusal in a unit. */
export function refusalIn(unit: Unit, { detail, range }: Refusal): string {
  return range === undefined ? detail : outOfRange(range.got, range.least, range.greatest, unit);
}

/** A field of a request: what people see it called, and in which unit. */
export interface Named extends Unit {
  readonly label: string;
}

/**
 * A problem as a sentence: its field by the label that people see, its numbers in that field's unit. Below `/edges_m`
 * all is called as that is.
 */
export function problemIn(fields: Readonly<Record<string, Named>>, problem: Problem): string {
  const { pointer, detail } = problem;
  if (pointer === undefined || pointer === null) return detail;
  const found = Object.keys(fields).find((name) => pointer === name || pointer.startsWith(`${name}/`));
  if (found === undefined) return pointer === "" ? detail : `${pointer}: ${detail}`;
  return `${fields[found].label}: ${refusalIn(fields[found], refusalOf(detail))}`;
}
