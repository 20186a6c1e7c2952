// The table laid out: a grid of delay by loss for every scheme, at one jitter and one profile.

import type { LatencyCell, LatencyTable, Profile } from "../../protocol/latency";
import { type Scheme, SCHEMES } from "../../protocol/session";

export interface Slice {
  readonly jitter_ratio: number;
  readonly profile: Profile;
}

export interface SchemeGrid {
  readonly scheme: string;
  /** One row per loss, one column per delay; nothing where the table has no such cell. */
  readonly rows: readonly (readonly (LatencyCell | undefined)[])[];
}

export interface Layout {
  readonly delays_s: readonly number[];
  readonly losses: readonly number[];
  readonly grids: readonly SchemeGrid[];
}

export function layOut(table: LatencyTable, slice: Slice): Layout {
  const cells = table.cells.filter((cell) => cell.profile === slice.profile && cell.jitter_ratio === slice.jitter_ratio);
  const delays_s = ascending(cells.map((cell) => cell.one_way_delay_s));
  const losses = ascending(cells.map((cell) => cell.loss));
  const grids = schemesOf(cells).map((scheme) => ({
    scheme,
    rows: losses.map((loss) => delays_s.map((delay_s) =>
      cells.find((cell) => cell.scheme === scheme && cell.loss === loss && cell.one_way_delay_s === delay_s))),
  }));
  return { delays_s, losses, grids };
}

/** What tells a cell from the others of its layout. */
export function cellName({ scheme, one_way_delay_s, loss }: LatencyCell): string {
  return `${scheme} ${one_way_delay_s} ${loss}`;
}

export function jittersOf(table: LatencyTable, profile: Profile): number[] {
  return ascending(table.cells.filter((cell) => cell.profile === profile).map((cell) => cell.jitter_ratio));
}

export function profilesOf(table: LatencyTable): Profile[] {
  return [...new Set(table.cells.map(({ profile }) => profile))];
}

/** Known schemes in the order of the scheme switch, then the others as they come. */
function schemesOf(cells: readonly LatencyCell[]): string[] {
  const there = new Set(cells.map(({ scheme }) => scheme));
  const known: string[] = SCHEMES.filter((scheme: Scheme) => there.has(scheme));
  return [...known, ...[...there].filter((scheme) => !known.includes(scheme))];
}

function ascending(values: readonly number[]): number[] {
  return [...new Set(values)].sort((a, b) => a - b);
}
