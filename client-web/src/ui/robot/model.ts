// What the Robot page is set to: which robot, how it bends, and where its platform is.

import { computed, signal } from "@preact/signals";
import type { Branch, RobotGeometry, Triple } from "../../protocol/theory";
import { bestHeight, OUTWARDS, poseAt, type RobotPose } from "../../theory/robot";
import { mathematics } from "../mathematics";
import { theory } from "../store";

/** The server's own default: a robot that fits on a desk. */
const DESKTOP: RobotGeometry = {
  base_radius_m: 0.12, platform_radius_m: 0.04, upper_link_m: 0.1, lower_link_m: 0.2, arm_angles_deg: [0, 120, 240],
};
/**
 * Where the desktop robot's handle rests: so high it moves alike in all directions. `teleclay-handle --device robot` is
 * at home there.
 */
const AMID_M = 0.17;
/** As fine as one answer may be: 91,125 of 100,000 cells. */
const CELLS = [45, 45, 45] as const;

export type Source = "live" | "hand";
export type Shown = "hull" | "slice" | "nothing";

export const geometry = signal<RobotGeometry>(DESKTOP);
export const branch = signal<Branch>(OUTWARDS);
export const source = signal<Source>("live");
export const shown = signal<Shown>("slice");
/** The platform's travel over the handle's. */
export const travel = signal(1);
/** Where the sliders put the platform. */
export const byHand_m = signal<Triple>([0, 0, AMID_M]);
/** Where the live handle puts it; moves at display rate. */
export const byHandle_m = signal<Triple>([0, 0, AMID_M]);

export const position_m = computed((): Triple => (source.value === "live" ? byHandle_m.value : byHand_m.value));
let before: RobotPose | undefined;
/** The robot as it is drawn: of the last dimensions that made a robot. Nothing before the mathematics is there. */
export const pose = computed((): RobotPose | undefined => {
  const module = mathematics.value;
  before = (module === undefined ? undefined : poseAt(module, geometry.value, position_m.value, branch.value)) ?? before;
  return before;
});

/** Where the handle's rest is put: of another robot than the desktop one, the most dexterous height on its axis. */
export const home_m = computed((): Triple => {
  if (JSON.stringify(geometry.value) === JSON.stringify(DESKTOP)) return [0, 0, AMID_M];
  const { answer } = theory.workspace.asked.value;
  return [0, 0, (answer === undefined ? undefined : bestHeight(answer)) ?? AMID_M];
});

export const workspaceQuestion = computed(() => ({ geometry: geometry.value, branch: branch.value, cells: CELLS }));

/** The handle, in the handle's own frame, as the platform follows it. */
export function platformAt(handle_m: Triple): Triple {
  const home = home_m.peek();
  const scale = travel.peek();
  return [home[0] + scale * handle_m[0], home[1] + scale * handle_m[1], home[2] + scale * handle_m[2]];
}
