import { describe, expect, it } from "vitest";
import type { JacobianAnswer, WorkspaceAnswer } from "../../protocol/theory";
import { bestHeight } from "../../theory/robot";
import { outOfReach, refusalOf, standingOf } from "./words";

const MAP: WorkspaceAnswer = {
  region_m: [[-0.1, -0.1, -0.2], [0.1, 0.1, 0.2]], cells: [1, 1, 4], branch: [-1, -1, -1],
  dexterity: [0.9, 0.2, 0.3, null], reachable_share: 0.75, reachable_volume_m3: 0.001, mean_dexterity: 0.4,
};
const POSTURE: JacobianAnswer = {
  jacobian: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], condition_number: 1.8, joints_rad: [0, 0, 0],
  elbows_m: [[0, 0, 0], [0, 0, 0], [0, 0, 0]], serial_measures: [0.8, 0.7, 0.9], parallel_measure: 0.5,
};

describe("the robot in words", () => {
  it("rests at the most dexterous height above its base", () => {
    expect(bestHeight(MAP)).toBeCloseTo(0.05);
    expect(bestHeight({ ...MAP, dexterity: [0.9, 0.2, null, null] })).toBeUndefined();
  });

  it("tells the two kinds of singularity apart, and names the arm", () => {
    expect(standingOf(POSTURE).grade).toBe("good");
    expect(standingOf({ ...POSTURE, serial_measures: [0.8, 0.05, 0.9] }).text).toContain("Arm 2 is nearly stretched or folded");
    expect(standingOf({ ...POSTURE, parallel_measure: 0.02 }).text).toContain("rods lie nearly in one plane");
  });

  it("says which arms are too short, and leaves other words to the server", () => {
    expect(outOfReach([0])).toContain("arm 1 does not get there");
    expect(outOfReach([0, 2])).toContain("arm 1 and arm 3 do not get there");
    expect(refusalOf({ type: "/problems/field", title: "", status: 422, detail: "5 is too much" })).toBe("5 is too much");
  });
});
