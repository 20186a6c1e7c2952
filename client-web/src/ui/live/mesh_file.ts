// A file that is to become clay: what it is, and what to do about one that the server refuses.

import type { Problem } from "../../protocol/session";

/** What is sent, by the end of the file's name. */
const TYPES: readonly (readonly [string, string])[] = [[".stl", "model/stl"], [".3mf", "model/3mf"]];

/** For the field that asks for a file. */
export const MESH_ENDINGS = TYPES.map(([ending]) => ending).join(",");

/** The media type of a file; nothing where it is neither of the two. */
export function meshTypeOf(name: string): string | undefined {
  return TYPES.find(([ending]) => name.toLowerCase().endsWith(ending))?.[1];
}

const ADVICE: readonly (readonly [RegExp, string])[] = [
  [/mesh[_-]open$/, "Clay has an inside: close the surface in a modelling program first."],
  [/mesh[_-]too[_-]large$/, "Reduce the number of triangles first."],
  [/mesh[_-]empty$/, "The file has no triangles in it, or none that enclose anything."],
];

/** Why a file was not taken, and what helps. */
export function meshRefusal(name: string, { type, detail }: Problem): string {
  const advice = ADVICE.find(([kind]) => kind.test(type))?.[1];
  return `${name}: ${detail}${/[.!?]$/.test(detail) ? "" : "."}${advice === undefined ? "" : ` ${advice}`}`;
}
