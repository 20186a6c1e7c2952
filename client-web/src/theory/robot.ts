// The parallel robot, as far as the picture needs it at every frame, by the module; the server's answers count. Metres,
// radians; arms j = 0, 1, 2.

import { ModuleRefusal } from "../protocol/instance";
import type { Arm, MathematicsModule } from "../protocol/mathematics";
import type { Branch, RobotGeometry, Triple, WorkspaceAnswer } from "../protocol/theory";

export const BRANCHES: readonly Branch[] = ([1, -1] as const).flatMap((a) =>
  ([1, -1] as const).flatMap((b) => ([1, -1] as const).map((c): Branch => [a, b, c])));

/** Elbows outwards, with the platform above the base. */
export const OUTWARDS: Branch = [-1, -1, -1];

/** The robot as it stands. */
export interface RobotPose {
  readonly geometry: RobotGeometry;
  readonly position_m: Triple;
  readonly arms: readonly Arm[];
  /** Arms that do not reach. */
  readonly short: readonly number[];
}

/** The arms with the platform at a position; nothing where the dimensions make no robot. */
export function poseAt(module: MathematicsModule, geometry: RobotGeometry, position_m: Triple, branch: Branch): RobotPose | undefined {
  try {
    const arms = module.arms(geometry, position_m, branch);
    return { geometry, position_m, arms, short: arms.flatMap(({ bend }, j) => (bend === undefined ? [j] : [])) };
  } catch (error) {
    if (error instanceof ModuleRefusal) return undefined;
    throw error;
  }
}

/** Height of the most dexterous cell of the column in the middle; nothing when the axis is out of reach. */
export function bestHeight({ region_m: [low, high], cells: [nx, ny, nz], dexterity }: WorkspaceAnswer): number | undefined {
  const column = Math.floor(nx / 2) + nx * Math.floor(ny / 2);
  let best: { readonly z: number; readonly dexterity: number } | undefined;
  for (let z = 0; z < nz; z += 1) {
    const here = dexterity[column + nx * ny * z];
    // Above the base, where elbows bend outwards; the mirror image below serves as well.
    const height = low[2] + ((z + 0.5) / nz) * (high[2] - low[2]);
    if (here !== null && 0 < height && (best === undefined || best.dexterity < here)) best = { z: height, dexterity: here };
  }
  return best?.z;
}
