// One scheme: loss down, delay across. The numbers stand in the cells, so that no one has to read colours.

import { useSignal } from "@preact/signals";
import type { JSX, TargetedKeyboardEvent } from "preact";
import type { LatencyCell } from "../../protocol/latency";
import { SCHEMES } from "../../protocol/session";
import { SCHEME_WORDS, schemeName } from "../scheme_words";
import { cellName, type SchemeGrid } from "./grid";
import { badness, type Measure, shortText } from "./measures";

interface HeatmapProps {
  readonly grid: SchemeGrid;
  readonly delays_s: readonly number[];
  readonly losses: readonly number[];
  readonly measure: Measure;
  readonly chosen: LatencyCell | undefined;
  readonly onChoose: (cell: LatencyCell) => void;
  /** The mouse is over a cell, or has left it. */
  readonly onPoint: (cell: LatencyCell | undefined) => void;
}

export function Heatmap({ grid: { scheme, rows }, delays_s, losses, measure, chosen, onChoose, onPoint }: HeatmapProps): JSX.Element {
  const known = SCHEMES.find((name) => name === scheme);
  // One stop of the tab key per map; arrows go on from there.
  const stop = useSignal<LatencyCell | undefined>(undefined);
  const cells = rows.flat().filter((cell) => cell !== undefined);
  const entry = [stop.value, chosen].find((cell) => cell !== undefined && cells.includes(cell)) ?? cells.at(0);
  return (
    <section class="panel heatmap" aria-label={schemeName(scheme)} data-testid={`map-${scheme}`}>
      <header><h2>{schemeName(scheme)}</h2>{known !== undefined && <span class="faint" title={SCHEME_WORDS[known].says}>{SCHEME_WORDS[known].says}</span>}</header>
      <table onKeyDown={moveFocus}>
        <thead>
          <tr>
            <th scope="col" class="corner">loss \ delay</th>
            {delays_s.map((delay_s) => <th key={delay_s} scope="col">{Number((1000 * delay_s).toPrecision(6))} <small>ms</small></th>)}
          </tr>
        </thead>
        <tbody>
          {rows.map((cells, row) => (
            <tr key={losses[row]}>
              <th scope="row">{Number((100 * losses[row]).toPrecision(4))} <small>%</small></th>
              {cells.map((cell, column) => (
                <td key={delays_s[column]}>
                  {cell !== undefined && (
                    <button
                      type="button"
                      tabIndex={cell === entry ? 0 : -1}
                      style={{ backgroundColor: colourOf(badness(measure, cell)) }}
                      data-stable={cell.stable}
                      data-cell={cellName(cell)}
                      aria-pressed={cell === chosen}
                      aria-label={labelOf(scheme, cell, measure)}
                      onClick={() => onChoose(cell)}
                      onPointerEnter={() => onPoint(cell)}
                      onPointerLeave={() => onPoint(undefined)}
                      onFocus={() => {
                        stop.value = cell;
                        onPoint(cell);
                      }}
                      onBlur={() => onPoint(undefined)}
                    >
                      {cell.stable ? shortText(measure.value(cell)) : `✕ ${shortText(measure.value(cell))}`}
                    </button>
                  )}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

/** Cells to the side, and up and down, by key. */
const STEPS: Record<string, readonly [number, number] | undefined> = {
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1], Home: [-Infinity, 0], End: [Infinity, 0],
};

function moveFocus(event: TargetedKeyboardEvent<HTMLTableElement>): void {
  const step = STEPS[event.key];
  if (step === undefined || !(event.target instanceof HTMLElement)) return;
  const rows = [...event.currentTarget.querySelectorAll("tbody tr")].map((row) => [...row.querySelectorAll<HTMLElement>("td button")]);
  const at = event.target;
  const row = rows.findIndex((buttons) => buttons.includes(at));
  if (row < 0) return;
  event.preventDefault();
  const to = rows[Math.min(Math.max(row + step[1], 0), rows.length - 1)];
  to.at(Math.min(Math.max(rows[row].indexOf(at) + step[0], 0), to.length - 1))?.focus();
}

function labelOf(scheme: string, cell: LatencyCell, measure: Measure): string {
  const where = `${schemeName(scheme)}, ${1000 * cell.one_way_delay_s} ms, ${100 * cell.loss} % loss`;
  return `${where}: ${measure.name} ${shortText(measure.value(cell))} ${measure.unit}${cell.stable ? "" : "; not stable"}`;
}

/** From good to bad over the theme's ramp, pale enough for the text on it. */
function colourOf(share: number | undefined): string {
  if (share === undefined) return "var(--inset)";
  const at = (1 - share) * 3;
  const n = Math.min(Math.floor(at), 2);
  const mixed = `color-mix(in oklab, var(--ramp-${n + 1}) ${Math.round(100 * (at - n))}%, var(--ramp-${n}))`;
  return `color-mix(in oklab, ${mixed} var(--ramp-share), var(--panel))`;
}
