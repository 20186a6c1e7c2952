import { describe, expect, it } from "vitest";
import { MeshArena } from "./arena";
import { Ranges, rounded } from "./ranges";
import type { BrickMesh } from "../protocol/module";

describe("the arena", () => {
  it("holds exactly the triangles of the meshes placed last, whatever came before", () => {
    const arena = new MeshArena();
    const held = new Map<number, BrickMesh>();
    let seed = 3;
    for (let step = 0; step < 2000; step += 1) {
      seed = (seed * 1103515245 + 12345) & 0x7fffffff;
      const brick = (seed >> 8) % 40;
      const mesh = (seed >> 16) % 5 === 0 ? undefined : fan(3 + ((seed >> 12) % 300), step);
      arena.replace(brick, mesh);
      if (mesh === undefined) held.delete(brick);
      else held.set(brick, mesh);
    }
    const wanted = [...held.values()].flatMap((mesh) => triangles(mesh.positions, mesh.indices)).sort();
    expect(triangles(arena.positions, arena.indices.subarray(0, arena.drawCount)).sort()).toEqual(wanted);
    expect(arena.triangles).toBe(wanted.length);
  });

  it("says what to upload: a replaced mesh costs its own bytes, not the clay's", () => {
    const arena = new MeshArena();
    for (let brick = 0; brick < 30; brick += 1) arena.replace(brick, fan(100, brick));
    expect(arena.takeChanges().grown).toBe(true);
    arena.replace(7, fan(90, 1));
    const { grown, vertices, indices } = arena.takeChanges();
    expect(grown).toBe(false);
    expect(vertices.reduce((sum, { count }) => sum + count, 0)).toBe(90);
    expect(indices.reduce((sum, { count }) => sum + count, 0)).toBe(3 * (100 - 2) + 3 * (90 - 2));
    expect(arena.takeChanges()).toEqual({ grown: false, vertices: [], indices: [] });
  });

  it("is empty after clearing", () => {
    const arena = new MeshArena();
    arena.replace(1, fan(20, 1));
    arena.clear();
    expect(arena.triangles).toBe(0);
    expect(arena.drawCount).toBe(0);
  });
});

describe("ranges", () => {
  it("never hand out the same place twice, and use again what was given back", () => {
    const ranges = new Ranges();
    const first = ranges.take(50);
    const second = ranges.take(50);
    expect(second - first).toBeGreaterThanOrEqual(50);
    ranges.giveBack(first, 50);
    expect(ranges.take(60)).toBe(first);
    expect(ranges.take(60)).toBe(ranges.end - rounded(60));
  });

  it("round up by less than half", () => {
    for (let length = 33; length < 5000; length += 1) {
      expect(rounded(length)).toBeGreaterThanOrEqual(length);
      expect(rounded(length)).toBeLessThan(1.5 * length);
    }
  });
});

/** A fan of `vertices` vertices, told apart by `tag`. */
function fan(vertices: number, tag: number): BrickMesh {
  const indices: number[] = [];
  for (let i = 1; i + 1 < vertices; i += 1) indices.push(0, i, i + 1);
  return {
    positions: Float32Array.from({ length: 3 * vertices }, (_, i) => i + tag),
    facing: new Int8Array(4 * vertices),
    indices: Uint16Array.from(indices),
  };
}

/** Each triangle as text; those without area are gaps. */
function triangles(positions: Float32Array, indices: Uint16Array | Uint32Array): string[] {
  const found: string[] = [];
  for (let t = 0; t < indices.length; t += 3) {
    if (indices[t] === indices[t + 1]) continue;
    found.push([0, 1, 2].map((i) => positions.subarray(3 * indices[t + i], 3 * indices[t + i] + 3).join()).join(" "));
  }
  return found;
}
