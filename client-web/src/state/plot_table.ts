// What plots show as a table: every sample of the time on show, whatever the picture could show of them.

import type { History, Stretch, Term } from "./history";

/** A column: its name, which ends in the unit, and what stands in it. */
export interface Column {
  readonly name: string;
  readonly term: Term;
}

/** Telemetry has 24 bits: more digits than these say nothing. */
const DIGITS = 7;
/** Microseconds, in the session's time. */
const TIME_PLACES = 6;
/** Rows of a piece: five minutes in one string would be held twice while it is made. */
const ROWS = 4096;

/** As RFC 4180 has it, in pieces. */
export function tableOf(history: History, columns: readonly Column[], stretch: Stretch): string[] {
  const pieces: string[] = [];
  let rows = [["time_s", ...columns.map(({ name }) => name)].join(",")];
  history.each(columns.map(({ term }) => term), stretch, (time_s, row) => {
    let line = time_s.toFixed(TIME_PLACES);
    for (const value of row) line += `,${Number.isFinite(value) ? Number(value.toPrecision(DIGITS)) : ""}`;
    rows.push(line);
    if (rows.length < ROWS) return;
    pieces.push(`${rows.join("\r\n")}\r\n`);
    rows = [];
  });
  if (0 < rows.length) pieces.push(`${rows.join("\r\n")}\r\n`);
  return pieces;
}
