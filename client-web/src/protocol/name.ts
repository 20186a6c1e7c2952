// Names of sessions: proto/src/names.rs holds them to the same.

const LONGEST = 64;
const STRANGE = /[^a-z0-9_-]/u;

/** Why a text is no name of a session, as a sentence without its full stop; nothing where it is one. */
export function nameFault(name: string): string | undefined {
  if (name === "") return "a name is missing";
  const strange = STRANGE.exec(name)?.[0];
  if (strange !== undefined) return `“${strange === " " ? "space" : strange}” cannot stand in a name: a–z, 0–9, - and _ can`;
  if (LONGEST < name.length) return `${name.length} characters are more than a name's ${LONGEST}`;
  return undefined;
}

/** The first of `base`, `base-2`, `base-3`, … that is not taken; a name where `base` is one. */
export function freeName(base: string, taken: readonly string[]): string {
  for (let n = 1; ; n += 1) {
    const ending = n === 1 ? "" : `-${n}`;
    const name = `${base.slice(0, LONGEST - ending.length)}${ending}`;
    if (!taken.includes(name)) return name;
  }
}
