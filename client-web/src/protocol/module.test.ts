import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { builtMathematics, builtModule } from "./built_module";
import { ModuleRefusal } from "./instance";
import { MathematicsModule } from "./mathematics";
import { moduleFrom, PageModule } from "./module";

/** A keyframe of 16 x 8 x 8 bricks, some of them told; the first of them is full. */
function keyframe(): ArrayBuffer {
  const { cases } = JSON.parse(readFileSync(new URL("../../../proto/vectors/bricks.json", import.meta.url), "utf8")) as { cases: { hex: string }[] };
  return Uint8Array.from(cases[1].hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16)).buffer;
}

describe("the module", () => {
  it("makes meshes of bricks, in memory of their own", async () => {
    const module = await builtModule();
    expect(module.takeInBricks(keyframe())).toBe(true);
    expect(module.describeClay()).toEqual({ epoch: 3, voxel_size_m: Math.fround(5e-4), bricks_per_axis: [16, 8, 8], stale: 16 * 8 * 8 });
    const first = module.meshNextBrick();
    if (first?.mesh === undefined) throw new Error("the first brick has no surface");
    const { positions, facing, indices } = first.mesh;
    expect(first.index).toBe(0);
    expect(facing.length / 4).toBe(positions.length / 3);
    expect(Math.max(...indices)).toBeLessThan(positions.length / 3);
    // The corner of the grid is a corner of the brick, and nothing of it lies beyond a neighbour's first voxel.
    expect([Math.min(...positions), Math.max(...positions)]).toEqual([0, expect.closeTo(16, 0)]);
    for (let v = 0; v < facing.length; v += 4) expect(Math.hypot(facing[v], facing[v + 1], facing[v + 2])).toBeCloseTo(127, -1);
    const copy = positions.slice();
    while (module.meshNextBrick() !== undefined) { /* until all are done */ }
    expect(positions).toEqual(copy);
    expect(module.describeClay().stale).toBe(0);
    expect(module.takeInBricks(keyframe())).toBe(false);
  });

  it("halves clay when it is told to", async () => {
    const module = await builtModule();
    module.halveClay();
    module.takeInBricks(keyframe());
    expect(module.describeClay()).toMatchObject({ voxel_size_m: 2 * Math.fround(5e-4), bricks_per_axis: [8, 4, 4] });
  });

  it("says why it refuses, as the one of mathematics does", async () => {
    const [module, mathematics] = [await builtModule(), await builtMathematics()];
    expect(() => module.takeInBricks(new ArrayBuffer(3))).toThrow(new ModuleRefusal("message starts with [0, 0], wanted [84, 67]"));
    expect(() => mathematics.outlook("position_force", 0.1)).toThrow(new ModuleRefusal("there is no loop to look at"));
  });
});

describe("a module that does not load", () => {
  it("says what is wrong with it", async () => {
    await expect(moduleFrom(Promise.resolve(new Response("", { status: 404 })))).rejects.toThrow(/answers 404/);
    await expect(moduleFrom(Promise.reject(new TypeError("Failed to fetch")))).rejects.toThrow(/Failed to fetch/);
    const headers = { "content-type": "application/wasm" };
    await expect(moduleFrom(Promise.resolve(new Response("no module", { headers })))).rejects.toThrow();
    // The smallest module there is: it has nothing of what this page calls.
    const empty = await WebAssembly.instantiate(Uint8Array.from([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0]), {});
    expect(() => new PageModule(empty.instance)).toThrow("the module has no function address");
    // Nor is one taken for another.
    const file = readFileSync(`${import.meta.dirname}/../../generated/page.wasm`);
    const page = await WebAssembly.instantiate(file, {});
    expect(() => new MathematicsModule(page.instance)).toThrow("the module has no function resize_numbers_in");
  });
});
