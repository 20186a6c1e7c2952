// The parallel robot, as far as the picture needs it at every frame: [KHMH03] (6)-(12). The server's answers count; a
// test holds this against the reference, and another against the server. Metres, radians; arms j = 0, 1, 2.

import type { Branch, RobotGeometry, Sign, Triple, WorkspaceAnswer } from "../protocol/theory";

export const BRANCHES: readonly Branch[] = ([1, -1] as const).flatMap((a) =>
  ([1, -1] as const).flatMap((b) => ([1, -1] as const).map((c): Branch => [a, b, c])));

/** Elbows outwards, with the platform above the base. */
export const OUTWARDS: Branch = [-1, -1, -1];

/** What is drawn of one arm. */
export interface ArmPose {
  readonly shoulder_m: Triple;
  readonly elbow_m: Triple;
  /** Where its rods end on the platform. */
  readonly wrist_m: Triple;
  readonly joint_rad: number;
}

/** The arms with the platform at a position; which arms do not reach, when some do not. */
export function armsAt(
  geometry: RobotGeometry,
  position_m: Triple,
  branch: Branch,
): { readonly arms: readonly ArmPose[]; readonly short: readonly number[] } {
  const arms: ArmPose[] = [];
  const short: number[] = [];
  for (let j = 0; j < 3; j += 1) {
    const joint_rad = jointAt(geometry, position_m, branch[j], j);
    if (joint_rad === undefined) short.push(j);
    else arms.push(armAt(geometry, position_m, joint_rad, j));
  }
  return { arms, short };
}

/** `rho_j` in (-pi, pi]; nothing out of reach. */
export function jointAt(geometry: RobotGeometry, position_m: Triple, sign: Sign, arm: number): number | undefined {
  const { base_radius_m, platform_radius_m, upper_link_m, lower_link_m } = geometry;
  const [ex, ey] = directionOf(geometry, arm);
  const offset = platform_radius_m - base_radius_m;
  const d = [position_m[0] + offset * ex, position_m[1] + offset * ey, position_m[2]];
  const r = d[0] * ex + d[1] * ey;
  const s = d[2];
  const t = (d[0] ** 2 + d[1] ** 2 + d[2] ** 2 + upper_link_m ** 2 - lower_link_m ** 2) / (2 * upper_link_m);
  const v = r * r + s * s - t * t; // (12)
  if (v < 0) return undefined;
  const root = sign * Math.sqrt(v);
  const angle = Math.atan2(s * t + r * root, r * t - s * root); // (10), (11)
  return angle === -Math.PI ? Math.PI : angle;
}

/** The unit vector along an arm, in the base's plane. */
export function directionOf(geometry: RobotGeometry, arm: number): readonly [number, number] {
  const angle = (geometry.arm_angles_deg[arm] * Math.PI) / 180;
  return [Math.cos(angle), Math.sin(angle)];
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

function armAt(geometry: RobotGeometry, position_m: Triple, joint_rad: number, arm: number): ArmPose {
  const [ex, ey] = directionOf(geometry, arm);
  const { base_radius_m, platform_radius_m, upper_link_m } = geometry;
  const out_m = base_radius_m + upper_link_m * Math.cos(joint_rad);
  return {
    shoulder_m: [base_radius_m * ex, base_radius_m * ey, 0],
    elbow_m: [out_m * ex, out_m * ey, upper_link_m * Math.sin(joint_rad)],
    wrist_m: [position_m[0] + platform_radius_m * ex, position_m[1] + platform_radius_m * ey, position_m[2]],
    joint_rad,
  };
}
