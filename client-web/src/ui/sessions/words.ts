// What a list of sessions says of each.

import type { Session, SessionEntry, Storage } from "../../protocol/session";
import { nameFault } from "../../protocol/name";

export const STORAGE_WORDS: Record<Storage["state"], string> = {
  durable: "saved",
  behind: "being saved",
  failed: "not saved",
  ephemeral: "in memory only",
};

/** Who holds a tool, or held one and has gone: `"Ada, Bob (gone)"`; and how many tools wait for somebody. */
export function operatorsOf({ tools }: Session): { readonly names: string; readonly free: number } {
  const held = tools.filter(({ operator }) => operator !== "");
  const names = held.map(({ operator, connected }) => (connected ? operator : `${operator} (gone)`)).join(", ");
  return { names, free: tools.length - held.length };
}

/** Why a session cannot be called so, as a sentence without its full stop; nothing where it can. */
export function fault(name: string, entries: readonly SessionEntry[]): string | undefined {
  return nameFault(name) ?? (entries.some(({ id }) => id === name) ? `there is a session ${name} already` : undefined);
}
