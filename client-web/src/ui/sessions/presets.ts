// Sessions that one may want: what is asked of the server for each. Whatever is left out has the server's default.

import type { NewSession } from "../../protocol/session";
import { materialOf, MATERIALS } from "../materials";

export interface Preset {
  /** What a session of this kind is called where nobody says otherwise. */
  readonly name: string;
  readonly title: string;
  readonly says: string;
  readonly body: Omit<NewSession, "id">;
}

export const PRESETS: readonly Preset[] = [
  {
    name: "block", title: "Block", says: "128 × 64 × 64 mm, a ball, the replica scheme",
    body: { scheme: "replica", clay: { shape: { kind: "block", size_m: [0.128, 0.064, 0.064] } } },
  },
  {
    name: "soft", title: "Soft block", says: "wet clay that hardly resists",
    body: { scheme: "replica", material: materialOf(MATERIALS.slip) },
  },
  {
    name: "firm", title: "Firm block", says: "stiff clay that holds its shape and is hard to cut",
    body: { scheme: "replica", material: materialOf(MATERIALS.firm) },
  },
  {
    name: "pair", title: "Two operators", says: "two tools in one block; each operator feels what the other cuts",
    body: { scheme: "replica", tools: 2 },
  },
  {
    name: "far", title: "Far away", says: "150 ms each way between hand and clay",
    body: { scheme: "replica", network: { up: { delay_s: 0.15 }, down: { delay_s: 0.15 } } },
  },
  {
    name: "large", title: "Large block", says: "128 × 128 × 64 mm: twice the clay, as fine",
    body: { scheme: "replica", clay: { shape: { kind: "block", size_m: [0.128, 0.128, 0.064] }, voxel_size_m: 5e-4 } },
  },
  {
    name: "mill", title: "End mill", says: "an upright cylinder 8 mm thick",
    body: { scheme: "replica", tool: { kind: "cylinder", radius_m: 0.004, height_m: 0.03 } },
  },
  {
    name: "ribbon", title: "Loop tool", says: "a ring of wire that takes a ribbon 18 mm wide: the wire feels, what passes through the ring is gone",
    body: { scheme: "replica", tool: { kind: "loop", ring_radius_m: 0.008, wire_diameter_m: 0.002 } },
  },
  {
    name: "steps", title: "Cutting experiment", says: "the paper's stepped block and a blade 1 cm wide",
    body: { scheme: "replica", clay: { shape: { kind: "stepped" } }, tool: { kind: "blade", width_m: 0.01, height_m: 0.04, thickness_m: 0.002 } },
  },
];

/** What is asked of the server. */
export function bodyOf(preset: Preset, id: string): NewSession {
  return { id, ...preset.body };
}
