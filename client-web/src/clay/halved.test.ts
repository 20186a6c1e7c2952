import { describe, expect, it } from "vitest";
import type { BricksMessage, BrickUpdate } from "../protocol/bricks";
import { BRICK_EDGE, BRICK_VOXELS } from "../protocol/packing";
import { halved } from "./halved";
import { ClayMirror } from "./mirror";

const message = (bricks: BrickUpdate[], keyframe: boolean): BricksMessage =>
  ({ sequence: 1, clay_epoch: 1, bricks_per_axis: [3, 2, 2], keyframe, voxel_size_m: 5e-4, bricks });

describe("clay at half the resolution", () => {
  it("keeps every voxel's clay, in its place", () => {
    // Clay where x + 2y + 3z, in voxels of the grid, is small: no axis may be taken for another.
    const level = (x: number, y: number, z: number): number => Math.min(Math.max(255 - 3 * (x + 2 * y + 3 * z), 0), 255);
    const mirror = new ClayMirror();
    mirror.apply(halved(message(bricksOf(level), true), mirror));
    expect(mirror.perAxis).toEqual([2, 1, 1]);
    expect(mirror.voxel_size_m).toBe(1e-3);
    for (const [x, y, z] of [[0, 0, 0], [17, 3, 9], [23, 15, 1], [9, 12, 15], [31, 15, 15]]) {
      const brick = mirror.voxels(x >> 4, 0, 0);
      const eight = [0, 1].flatMap((c) => [0, 1].flatMap((b) => [0, 1].map((a) => (2 * x + a < 48 ? level(2 * x + a, 2 * y + b, 2 * z + c) : 0))));
      expect(brick[(x & 15) + BRICK_EDGE * (y + BRICK_EDGE * z)]).toBe(Math.round(eight.reduce((sum, v) => sum + v, 0) / 8));
    }
  });

  it("changes only the eighth that a brick is of, and knows uniform bricks again", () => {
    const mirror = new ClayMirror();
    const all = Array.from({ length: 12 }, (_, index): BrickUpdate => ({ index, content: "full" }));
    mirror.apply(halved(message(all, true), mirror));
    expect(mirror.isUniform(mirror.voxels(0, 0, 0), 255)).toBe(true);
    mirror.apply(halved(message([{ index: 1 + 3 * (1 + 2 * 0), content: "empty" }], false), mirror));
    const brick = mirror.voxels(0, 0, 0);
    let gone = 0;
    brick.forEach((voxel, i) => {
      const [x, y, z] = [i & 15, (i >> 4) & 15, i >> 8];
      const inside = 8 <= x && 8 <= y && z < 8;
      expect(voxel).toBe(inside ? 0 : 255);
      if (inside) gone += 1;
    });
    expect(gone).toBe(BRICK_VOXELS / 8);
    mirror.apply(halved(message([{ index: 4, content: "full" }], false), mirror));
    expect(mirror.isUniform(mirror.voxels(0, 0, 0), 255)).toBe(true);
  });

  it("forgets all that was, when a keyframe comes", () => {
    const mirror = new ClayMirror();
    mirror.apply(halved(message([{ index: 0, content: "full" }], true), mirror));
    mirror.apply(halved(message([{ index: 1, content: "full" }], true), mirror));
    expect(mirror.voxels(0, 0, 0)[0]).toBe(0);
    expect(mirror.voxels(0, 0, 0)[8]).toBe(255);
  });
});

function bricksOf(level: (x: number, y: number, z: number) => number): BrickUpdate[] {
  return Array.from({ length: 12 }, (_, index): BrickUpdate => {
    const [bx, by, bz] = [index % 3, Math.floor(index / 3) % 2, Math.floor(index / 6)];
    return {
      index,
      content: Uint8Array.from({ length: BRICK_VOXELS }, (_voxel, i) =>
        level(16 * bx + (i & 15), 16 * by + ((i >> 4) & 15), 16 * bz + (i >> 8))),
    };
  });
}
