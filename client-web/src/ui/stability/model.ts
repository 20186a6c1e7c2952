// What the Stability page is set to, and the question that follows from it.

import { computed, signal } from "@preact/signals";
import type { LoopRequest } from "../../protocol/theory";
import type { LoopParts } from "../../theory/loop";

export type PlantAxis = "x" | "y";

export interface Settings {
  readonly axis: PlantAxis;
  /** `C_h1 = 1 / (M s² + B s + K)`. */
  readonly mass_kg: number;
  readonly damping_n_s_per_m: number;
  readonly stiffness_n_per_m: number;
  readonly position_ratio: number;
  /** Force ratio `|A_h2|`, hand force per clay force. */
  readonly force_ratio: number;
  readonly clay_damping_n_s_per_m: number;
  readonly clay_stiffness_n_per_m: number;
}
export type NumberSetting = Exclude<keyof Settings, "axis">;

const PAPER: Settings = {
  axis: "x",
  mass_kg: 1, damping_n_s_per_m: 10, stiffness_n_per_m: 0,
  position_ratio: 1, force_ratio: 1,
  clay_damping_n_s_per_m: 20, clay_stiffness_n_per_m: 0,
};

interface Preset {
  readonly name: string;
  readonly says: string;
  readonly settings: Settings;
  readonly round_trip_s: number;
}

export const PRESETS: readonly Preset[] = [
  {
    name: "paper", says: "the paper's handle in soft clay: position–force bears 147 ms, force exchange any delay",
    settings: PAPER, round_trip_s: 0.2,
  },
  {
    name: "firm clay", says: "the same handle in clay three times as viscous: position–force dies within 16 ms",
    settings: { ...PAPER, clay_damping_n_s_per_m: 60 }, round_trip_s: 0.03,
  },
  {
    name: "light handle", says: "a handle too light for firm clay: unstable even without delay",
    settings: { ...PAPER, mass_kg: 0.2, damping_n_s_per_m: 5, clay_damping_n_s_per_m: 60 }, round_trip_s: 0.01,
  },
  {
    name: "sprung handle", says: "a light, sprung handle: here force exchange has a margin, too, of 2 ms",
    settings: {
      ...PAPER, axis: "y", mass_kg: 0.02, damping_n_s_per_m: 0.4, stiffness_n_per_m: 2,
      clay_damping_n_s_per_m: 20, clay_stiffness_n_per_m: 10,
    },
    round_trip_s: 0.01,
  },
];

export const settings = signal<Settings>(PAPER);
/** There and back. Apart from the settings: margins say what it does, so the server need not be asked when it moves. */
export const round_trip_s = signal(0.2);

export function set(name: NumberSetting, value: number): void {
  settings.value = { ...settings.value, [name]: value };
}

/** (35) and (36): the identified servo of either axis, from commanded to actual position. */
const SERVO: Record<PlantAxis, LoopRequest["g_h"]> = {
  x: { numerator: [18, 1], denominator: [0.005, 0.4, 18, 1] },
  y: { numerator: [8, 1], denominator: [0.002, 0.17, 8, 1] },
};
/** (37): the arm, N per m. */
const ARM = [0.25, 2, 6];
/** Tool actuator: 0.5 kg, 20 N·s/m. It shapes the compensators, and drops out of the loop. */
const TOOL: LoopRequest["g_t"] = { numerator: [1], denominator: [0.5, 20, 0] };

export function partsOf(of: Settings): LoopParts {
  return {
    g_h: SERVO[of.axis],
    c_h1: { numerator: [1], denominator: [of.mass_kg, of.damping_n_s_per_m, of.stiffness_n_per_m] },
    t_h: ARM,
    position_ratio: of.position_ratio,
    force_ratio: -of.force_ratio,
    clay_damping_n_s_per_m: of.clay_damping_n_s_per_m,
    clay_stiffness_n_per_m: of.clay_stiffness_n_per_m,
  };
}

export const question = computed((): LoopRequest => ({ ...partsOf(settings.value), g_t: TOOL }));
