import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import { builtMathematics } from "../protocol/built_module";
import type { MathematicsModule } from "../protocol/mathematics";
import type { RobotGeometry, Triple } from "../protocol/theory";
import { BRANCHES, poseAt } from "./robot";

interface Reference {
  geometry: RobotGeometry;
  unreachable_m: Triple[];
  reachable: { position_m: Triple; joints_rad: Triple[] }[];
}

const REFERENCES = JSON.parse(
  readFileSync(`${import.meta.dirname}/../../../crates/kinematics/tests/reference/cases.json`, "utf8"),
) as Reference[];

let module: MathematicsModule;
beforeAll(async () => {
  module = await builtMathematics();
});

describe("the robot", () => {
  it("has the reference's joint angles on all eight branches", () => {
    for (const { geometry, reachable } of REFERENCES) {
      for (const { position_m, joints_rad } of reachable) {
        const found = BRANCHES.map((branch) => poseAt(module, geometry, position_m, branch)?.arms.map(({ bend }) => bend?.joint_rad) ?? []);
        found.forEach((joints, n) => joints.forEach((joint, j) => expect(joint).toBeCloseTo(joints_rad[n][j], 9)));
        expect(found.flat().length).toBe(24);
      }
    }
  });

  it("has rods of one length, whatever the branch", () => {
    for (const { geometry, reachable } of REFERENCES) {
      for (const { position_m } of reachable) {
        for (const branch of BRANCHES) {
          for (const { shoulder_m, bend, wrist_m } of poseAt(module, geometry, position_m, branch)?.arms ?? []) {
            if (bend === undefined) throw new Error("an arm of the reference does not reach");
            expect(distance(shoulder_m, bend.elbow_m)).toBeCloseTo(geometry.upper_link_m, 12);
            expect(distance(bend.elbow_m, wrist_m)).toBeCloseTo(geometry.lower_link_m, 9);
          }
        }
      }
    }
  });

  it("says which arms are too short where the reference is out of reach", () => {
    let asked = 0;
    for (const { geometry, unreachable_m } of REFERENCES) {
      for (const position_m of unreachable_m) {
        asked += 1;
        expect(poseAt(module, geometry, position_m, [1, 1, 1])?.short.length).toBeGreaterThan(0);
      }
    }
    expect(asked).toBeGreaterThan(0);
  });

  it("is nothing where the dimensions make none", () => {
    const [{ geometry }] = REFERENCES;
    expect(poseAt(module, { ...geometry, upper_link_m: 0 }, [0, 0, 0.1], [1, 1, 1])).toBeUndefined();
  });
});

function distance(a: Triple, b: Triple): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}
