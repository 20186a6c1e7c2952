// What there is to say of a recording: how it ends, what is missing, whether its clay comes out.

import type { FilmFacts, FilmMoment, Gap, Why } from "../../protocol/film";
import { fixed } from "../format";

export interface Remark {
  readonly level: "info" | "warning" | "error";
  readonly text: string;
}

/** Of the file as a whole, what matters most first. `goesOn`: it was still written when it was opened. */
export function remarksOf(facts: FilmFacts, { isRead, goesOn }: { readonly isRead: boolean; readonly goesOn: boolean }): Remark[] {
  const remarks: Remark[] = [];
  if (facts.differs_s !== null) {
    remarks.push({ level: "error", text: `At ${fixed(facts.differs_s, 3)} s its cuts make another clay than it tells of: from there on the picture is not to be trusted.` });
  }
  if (isRead && goesOn) remarks.push({ level: "info", text: "It still goes on: what was written so far is shown." });
  else if (isRead && facts.end === "cut_off") {
    remarks.push({ level: "warning", text: "Its file was cut off, as when a server is killed: all up to the last whole piece is shown." });
  }
  if (isRead && facts.ticks === 0) remarks.push({ level: "warning", text: "There is no moment in it: it ended before its first state was written." });
  if (0 < facts.dropped) remarks.push({ level: "warning", text: `${facts.dropped} ticks found no room on their way to the file, and are missing.` });
  remarks.push(...facts.gaps.slice(0, MOST_GAPS).map((gap) => ({ level: "warning", text: gapWords(gap) } as const)));
  if (MOST_GAPS < facts.gaps.length) remarks.push({ level: "warning", text: `There are ${facts.gaps.length - MOST_GAPS} more such stretches.` });
  if (facts.reason !== null) remarks.push({ level: "info", text: `It ended because: ${facts.reason}.` });
  return remarks;
}

/** Of a moment: what of it cannot be shown, or what rests. */
export function remarkOf(moment: FilmMoment): Remark | undefined {
  if (moment.clay === null) {
    return moment.lost === null
      ? { level: "info", text: "The clay is not there yet: its first state stands some ticks behind the start." }
      : { level: "warning", text: `The clay on show is an older one: ${whyWords(moment.lost)}.` };
  }
  return moment.is_full ? { level: "warning", text: "What was cut could not be kept then, and tools rested." } : undefined;
}

function gapWords({ from_s, to_s, why }: Gap): string {
  const until = to_s === null ? "on" : `to ${fixed(to_s, 3)} s`;
  return `From ${fixed(from_s, 3)} s ${until} its clay is unknown: ${whyWords(why)}.`;
}

function whyWords(why: Why): string {
  switch (why.kind) {
    case "dropped": return `${why.ticks} ticks before it found no room in the recording`;
    case "missing": return `${why.ticks} ticks before it are missing, and the recording does not say why`;
    case "elsewhere": return "a cut was undone that is older than the last state, or a block came from a file";
    case "broken": return `its history does not follow (${why.why})`;
  }
}

/** Gaps that are told one by one. */
const MOST_GAPS = 3;
