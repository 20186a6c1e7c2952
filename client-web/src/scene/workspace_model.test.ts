import { describe, expect, it } from "vitest";
import { hullOf } from "./workspace_model";

describe("the hull of a workspace", () => {
  it("has the reachable cells that border on what is not, at their centres", () => {
    // 4³ cells of 10 mm; reachable but for the corner column at x = y = 3.
    const cells = [4, 4, 4] as const;
    const dexterity = Array.from({ length: 64 }, (_, i) => (i % 4 === 3 && (i >> 2) % 4 === 3 ? null : 0.5));
    const hull = hullOf({ low_m: [0, 0, 0], high_m: [0.04, 0.04, 0.04], cells, dexterity });
    // All outer cells but the missing column, and of the inner 2³ none: none of them touches the column by a face.
    expect(hull.length).toBe(64 - 8 - 4);
    expect(hull[0].at_m.map((m) => Number(m.toFixed(6)))).toEqual([0.005, 0.005, 0.005]);
  });
});
