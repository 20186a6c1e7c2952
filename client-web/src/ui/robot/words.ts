// What the robot cannot do, in plain words.

import type { Problem } from "../../protocol/session";
import type { JacobianAnswer } from "../../protocol/theory";

/** Below this a posture is called near to singular: the numbers get large there. */
const NEAR = 0.15;

export interface Standing {
  readonly grade: "good" | "warn" | "bad";
  readonly text: string;
}

/** How a posture stands, from the server's measures. */
export function standingOf({ serial_measures, parallel_measure, condition_number }: JacobianAnswer): Standing {
  const serial = Math.min(...serial_measures);
  const arm = serial_measures.indexOf(serial) + 1;
  if (serial < NEAR && serial <= parallel_measure) {
    return { grade: "warn", text: `Arm ${arm} is nearly stretched or folded: along it the platform can hardly move.` };
  }
  if (parallel_measure < NEAR) {
    return { grade: "warn", text: "The rods lie nearly in one plane: the platform can move although no joint does, and no torque holds it." };
  }
  return { grade: "good", text: `Clear of every singularity. A joint rate moves the platform up to ${condition_number.toFixed(1)} times as fast one way as another.` };
}

/** Which arms do not get there, 0 … 2. */
export function outOfReach(short: readonly number[]): string {
  return `Out of reach: ${list(short.map((arm) => `arm ${arm + 1}`))} ${short.length === 1 ? "does" : "do"} not get there. Move the platform towards the middle.`;
}

/** A refusal of the server's, said for a person; its own words where it is of another kind. */
export function refusalOf(problem: Problem): string {
  const kind = problem.type.slice(problem.type.lastIndexOf("/") + 1);
  switch (kind) {
    case "unreachable":
      return "Out of reach.";
    case "singular":
      return `At a singularity: ${problem.detail}. Here joints and platform no longer move together.`;
    case "no-assembly":
      return `These joint angles hold no platform: ${problem.detail}.`;
    default:
      return problem.detail;
  }
}

function list(words: readonly string[]): string {
  return words.length < 2 ? words.join("") : `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`;
}
