// Which curves there are. A field that telemetry gains becomes a curve here.

import type { Session, ToolState } from "../../protocol/session";
import type { Term } from "../../state/history";
import { Kept } from "../../state/samples";

/** What a curve may depend on. */
interface Moment {
  /** 0, 1, 2 for x, y, z. */
  readonly axis: number;
  readonly session: Pick<Session, "position_ratio">;
  readonly tool: Pick<ToolState, "home_m">;
}

interface CurveSpec {
  readonly label: string;
  /** In a table of the values, before axis and unit. */
  readonly column: string;
  readonly colour: string;
  /** Curves that lie on one another are told apart by their width: what is drawn first is wider. */
  readonly width?: number;
  /** What is drawn, in the plot's unit. */
  readonly term: (moment: Moment) => Term;
}

export interface PlotSpec {
  /** Unique within its set. */
  readonly name: string;
  readonly title: string;
  readonly unit: keyof typeof UNITS;
  /** One axis of a vector, whichever is chosen. */
  readonly hasAxis: boolean;
  readonly says?: string;
  readonly places: number;
  /** Height of the smallest range worth showing, in the unit. */
  readonly least: number;
  readonly curves: readonly CurveSpec[];
}

/** Units as they end the names of a table's columns. */
const UNITS = { N: "n", mm: "mm", "mm/s": "mm_s", mJ: "mj", ms: "ms" } as const;
export const AXES = ["x", "y", "z"] as const;

/** A curve's name in a table, which ends in its unit: `hand_force_x_n`. */
export function columnOf(spec: PlotSpec, { column }: CurveSpec, axis: number): string {
  return `${column}${spec.hasAxis ? `_${AXES[axis]}` : ""}_${UNITS[spec.unit]}`;
}

export type PlotSet = "motion" | "link" | "copy";

const MM = 1000;
const MJ = 1000;
const MS = 1000;

const scalar = (channel: number, factor = 1) => (): Term => ({ channel, factor, offset: 0 });
/** One component of a vector, times a factor. */
const component = (channel: number, factor = 1) => ({ axis }: Moment): Term => ({ channel: channel + axis, factor, offset: 0 });
/** The handle where it would have the tool, and as fast. */
const handlePosition = ({ axis, session, tool }: Moment): Term =>
  ({ channel: Kept.handle_position_m + axis, factor: MM * session.position_ratio, offset: MM * tool.home_m[axis] });
const handleVelocity = ({ axis, session }: Moment): Term =>
  ({ channel: Kept.handle_velocity_m_s + axis, factor: MM * session.position_ratio, offset: 0 });

const FELT_AGAINST_CLAY: PlotSpec = {
  name: "hidden", title: "Felt, clay", unit: "N", hasAxis: true, places: 2, least: 0.2,
  says: "the force that the hand feels, the clay's own on the tool, and what the first hides of the second",
  curves: [
    { label: "felt", column: "felt_force", colour: "--felt", width: 3, term: component(Kept.felt_force_n) },
    { label: "clay", column: "tool_force", colour: "--tool", term: component(Kept.tool_force_n) },
    { label: "apart", column: "felt_less_tool_force", colour: "--text", term: component(Kept.felt_less_clay_n) },
  ],
};

export const PLOT_SETS: Record<PlotSet, readonly PlotSpec[]> = {
  motion: [
    {
      name: "force", title: "Force", unit: "N", hasAxis: true, places: 2, least: 0.2,
      curves: [
        { label: "hand", column: "hand_force", colour: "--hand", width: 3, term: component(Kept.hand_force_n) },
        { label: "felt", column: "felt_force", colour: "--felt", width: 3, term: component(Kept.felt_force_n) },
        { label: "tool", column: "tool_force", colour: "--tool", term: component(Kept.tool_force_n) },
      ],
    },
    {
      name: "position", title: "Position", unit: "mm", hasAxis: true, places: 1, least: 2,
      says: "of the tool, and of the handle where it would have the tool",
      curves: [
        { label: "hand", column: "hand_position", colour: "--hand", width: 3, term: handlePosition },
        { label: "tool", column: "tool_position", colour: "--tool", term: component(Kept.tool_position_m, MM) },
      ],
    },
    {
      name: "velocity", title: "Velocity", unit: "mm/s", hasAxis: true, places: 0, least: 5,
      says: "of the tool, and of the handle as it would have the tool",
      curves: [
        { label: "hand", column: "hand_velocity", colour: "--hand", width: 3, term: handleVelocity },
        { label: "tool", column: "tool_velocity", colour: "--tool", term: component(Kept.tool_velocity_m_s, MM) },
      ],
    },
  ],
  link: [
    {
      name: "energy", title: "Link energy", unit: "mJ", hasAxis: false, places: 2, least: 0.5,
      says: "into the link at the handle's port, at the tool's port, and both together: below zero together, the link has made energy",
      curves: [
        { label: "handle", column: "handle_energy", colour: "--hand", term: scalar(Kept.energy_handle_j, MJ) },
        { label: "tool", column: "tool_energy", colour: "--tool", term: scalar(Kept.energy_tool_j, MJ) },
        { label: "both", column: "both_energy", colour: "--text", width: 2, term: scalar(Kept.energy_both_j, MJ) },
      ],
    },
    FELT_AGAINST_CLAY,
    {
      name: "round-trip", title: "Round trip", unit: "ms", hasAxis: false, places: 2, least: 1,
      says: "handle to tool and back",
      curves: [{ label: "round trip", column: "round_trip", colour: "--accent", term: scalar(Kept.rtt_s, MS) }],
    },
  ],
  copy: [
    FELT_AGAINST_CLAY,
    {
      name: "corrections", title: "Corrections", unit: "N", hasAxis: false, places: 3, least: 0.1,
      says: "how far news of the clay moves the felt force, from sample to sample, and what of it is still held back",
      curves: [
        { label: "held back", column: "correction_held", colour: "--text", term: scalar(Kept.correction_held_n) },
        { label: "let in", column: "correction_step", colour: "--accent", width: 2, term: scalar(Kept.correction_step_n) },
      ],
    },
    {
      name: "age", title: "News", unit: "ms", hasAxis: false, places: 1, least: 5,
      says: "how long ago the newest frame from the hand came: as far as the server's clay is behind its copy, besides the delay",
      curves: [{ label: "age", column: "news_age", colour: "--accent", term: scalar(Kept.age_s, MS) }],
    },
  ],
};
