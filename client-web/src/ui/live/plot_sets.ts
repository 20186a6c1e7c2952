// Which curves there are. A field that telemetry gains becomes a curve here.

import { Channel } from "../../protocol/telemetry";
import type { Session, ToolState } from "../../protocol/session";
import type { Term } from "../../state/history";

/** What a curve may depend on. */
interface Moment {
  /** 0, 1, 2 for x, y, z. */
  readonly axis: number;
  readonly session: Session;
  readonly tool: ToolState;
}

interface CurveSpec {
  readonly label: string;
  readonly colour: string;
  /** Curves that lie on one another are told apart by their width: what is drawn first is wider. */
  readonly width?: number;
  /** What is summed, in the plot's unit. */
  readonly terms: (moment: Moment) => readonly Term[];
  /** Added to the sum. */
  readonly offset?: (moment: Moment) => number;
}

export interface PlotSpec {
  /** Unique within its set. */
  readonly name: string;
  readonly title: string;
  readonly unit: string;
  readonly says?: string;
  readonly places: number;
  /** Height of the smallest range worth showing, in the unit. */
  readonly least: number;
  readonly curves: readonly CurveSpec[];
}

export type PlotSet = "motion" | "link" | "copy";

const MM = 1000;
const MJ = 1000;
const MS = 1000;

/** One component of a vector, times a factor. */
const component = (channel: number, factor = 1) => ({ axis }: Moment): Term[] => [{ channel: channel + axis, factor }];
/** The handle where it would have the tool. */
const handle = (channel: number) => ({ axis, session }: Moment): Term[] => [{ channel: channel + axis, factor: MM * session.position_ratio }];

const FELT_AGAINST_CLAY: PlotSpec = {
  name: "hidden", title: "Felt, clay", unit: "N", places: 2, least: 0.2,
  says: "the force that the hand feels, the clay's own on the tool, and what the first hides of the second",
  curves: [
    { label: "felt", colour: "--felt", width: 3, terms: component(Channel.felt_force_n) },
    { label: "clay", colour: "--tool", terms: component(Channel.tool_force_n) },
    {
      label: "apart", colour: "--text",
      terms: ({ axis }) => [{ channel: Channel.felt_force_n + axis, factor: 1 }, { channel: Channel.tool_force_n + axis, factor: -1 }],
    },
  ],
};

export const PLOT_SETS: Record<PlotSet, readonly PlotSpec[]> = {
  motion: [
    {
      name: "force", title: "Force", unit: "N", places: 2, least: 0.2,
      curves: [
        { label: "hand", colour: "--hand", width: 3, terms: component(Channel.hand_force_n) },
        { label: "felt", colour: "--felt", width: 3, terms: component(Channel.felt_force_n) },
        { label: "tool", colour: "--tool", terms: component(Channel.tool_force_n) },
      ],
    },
    {
      name: "position", title: "Position", unit: "mm", places: 1, least: 2,
      curves: [
        { label: "hand", colour: "--hand", width: 3, terms: handle(Channel.handle_position_m), offset: ({ axis, tool }) => MM * tool.home_m[axis] },
        { label: "tool", colour: "--tool", terms: component(Channel.tool_position_m, MM) },
      ],
    },
    {
      name: "velocity", title: "Velocity", unit: "mm/s", places: 0, least: 5,
      curves: [
        { label: "hand", colour: "--hand", width: 3, terms: handle(Channel.handle_velocity_m_s) },
        { label: "tool", colour: "--tool", terms: component(Channel.tool_velocity_m_s, MM) },
      ],
    },
  ],
  link: [
    {
      name: "energy", title: "Link energy", unit: "mJ", places: 2, least: 0.5,
      says: "into the link at the handle's port, at the tool's port, and both together: below zero together, the link has made energy",
      curves: [
        { label: "handle", colour: "--hand", terms: () => [{ channel: Channel.energy_handle_j, factor: MJ }] },
        { label: "tool", colour: "--tool", terms: () => [{ channel: Channel.energy_tool_j, factor: MJ }] },
        {
          label: "both", colour: "--text", width: 2,
          terms: () => [{ channel: Channel.energy_handle_j, factor: MJ }, { channel: Channel.energy_tool_j, factor: MJ }],
        },
      ],
    },
    FELT_AGAINST_CLAY,
    {
      name: "round-trip", title: "Round trip", unit: "ms", places: 2, least: 1,
      says: "handle to tool and back",
      curves: [{ label: "round trip", colour: "--accent", terms: () => [{ channel: Channel.rtt_s, factor: MS }] }],
    },
  ],
  copy: [
    FELT_AGAINST_CLAY,
    {
      name: "corrections", title: "Corrections", unit: "N", places: 3, least: 0.1,
      says: "how far news of the clay moves the felt force, from sample to sample, and what of it is still held back",
      curves: [
        { label: "held back", colour: "--text", terms: () => [{ channel: Channel.correction_held_n, factor: 1 }] },
        { label: "let in", colour: "--accent", width: 2, terms: () => [{ channel: Channel.correction_step_n, factor: 1 }] },
      ],
    },
    {
      name: "age", title: "News", unit: "ms", places: 1, least: 5,
      says: "how long ago the newest frame from the hand came: as far as the server's clay is behind its copy, besides the delay",
      curves: [{ label: "age", colour: "--accent", terms: () => [{ channel: Channel.age_s, factor: MS }] }],
    },
  ],
};
