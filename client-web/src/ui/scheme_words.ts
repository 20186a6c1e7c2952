// Schemes as a person calls them, and what each does, in a sentence.

import type { Scheme } from "../protocol/session";

export const SCHEME_WORDS: Record<Scheme, { name: string; says: string }> = {
  force_exchange: { name: "Force exchange", says: "Each side moves by both forces. Stable at most delays, but hand and tool drift apart." },
  position_force: { name: "Position–force", says: "Position goes up, force comes back. Crisp without delay, unstable with it." },
  wave: { name: "Wave variables", says: "Passive at any delay; the longer the line, the softer stiff clay feels." },
  tdpa: { name: "Time-domain passivity", says: "Watches the energy of the line and dissipates what it would add." },
  replica: { name: "Replica", says: "The hand cuts a copy of the clay without any delay; the server stays the authority." },
};

/** A scheme's name; as it is written where this page does not know it. */
export function schemeName(scheme: string): string {
  const known = Object.entries(SCHEME_WORDS).find(([name]) => name === scheme);
  return known === undefined ? scheme : known[1].name;
}
