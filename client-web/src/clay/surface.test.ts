import { describe, expect, it } from "vitest";
import type { BricksMessage, BrickUpdate } from "../protocol/bricks";
import { ClayMirror } from "./mirror";
import { Neighbourhood } from "./neighbourhood";
import { type BrickMesh, SurfaceFinder } from "./surface";

type Field = (x: number, y: number, z: number) => number;

describe("the surface", () => {
  it("of a fresh block is closed, of the block's volume, and flat faces cost little", () => {
    const clay = fill([4, 3, 2], () => 255);
    const meshes = meshAll(clay);
    const { open, volume, triangles } = survey(meshes);
    expect(open).toBe(0);
    // Surface nets bevel the block's edges: the vertex of an edge cell lies a quarter voxel inside both faces, so that
    // a quarter of a voxel is lost per voxel of edge, a little less at the eight corners.
    const edges = 4 * (64 + 48 + 32);
    expect(Math.abs(volume - (64 * 48 * 32 - edges / 4))).toBeLessThan(4);
    expect(triangles).toBeLessThan((2 * 2 * (64 * 48 + 48 * 32 + 32 * 64)) / 2);
  });

  it("is closed after cuts along, across and diagonal to the bricks, with the volume that is left", () => {
    for (const [name, field] of Object.entries(cuts)) {
      const clay = fill([3, 3, 3], field);
      const { open, volume } = survey(meshAll(clay));
      expect(open, name).toBe(0);
      expect(Math.abs(volume / occupied(field, 48) - 1), name).toBeLessThan(0.005);
    }
  });

  it("is closed for any occupancies whatever, steps and noise included", () => {
    let seed = 7;
    const noise: Field = () => {
      seed = (seed * 1103515245 + 12345) & 0x7fffffff;
      return seed >> 23;
    };
    expect(survey(meshAll(fill([2, 2, 2], noise))).open).toBe(0);
  });

  it("of a ball faces away from its centre", () => {
    const [c, r] = [24.3, 14.6];
    const meshes = meshAll(fill([3, 3, 3], (x, y, z) => band(r - Math.hypot(x - c, y - c, z - c))));
    let worst = 0;
    for (const { positions, facing } of meshes.values()) {
      for (let v = 0; v < positions.length / 3; v += 1) {
        const out = [0, 1, 2].map((i) => positions[3 * v + i] - c);
        const length = Math.hypot(...out);
        const normal = facing.subarray(4 * v, 4 * v + 3);
        const cosine = out.reduce((sum, p, i) => sum + (p / length) * (normal[i] / Math.hypot(...normal)), 0);
        worst = Math.max(worst, Math.acos(Math.min(cosine, 1)));
        expect(Math.abs(length - r)).toBeLessThan(0.2);
      }
    }
    expect(worst).toBeLessThan(0.03);
  });

  it("after an edit, found again only where it is stale, is the same as when all is found anew", () => {
    const before: Field = (x, y, z) => cuts.along(x, y, z);
    const after: Field = (x, y, z) => Math.min(before(x, y, z), band(Math.hypot(x - 17, y - 15.2, z - 33) - 6.4));
    const mirror = new ClayMirror();
    mirror.apply(message([3, 3, 3], before));
    const meshes = meshStale(mirror, new Map());
    const whole = message([3, 3, 3], after);
    mirror.apply({ ...whole, keyframe: false });
    expect(mirror.staleBricks).toBeLessThan(27);
    meshStale(mirror, meshes);
    const anew = meshAll(fill([3, 3, 3], after));
    expect([...meshes.keys()].sort()).toEqual([...anew.keys()].sort());
    for (const [index, mesh] of anew) expect(meshes.get(index)).toEqual(mesh);
  });
});

describe("the mirror", () => {
  it("calls nothing stale when a brick comes again unchanged", () => {
    const mirror = new ClayMirror();
    const all = message([3, 3, 3], cuts.diagonal);
    mirror.apply(all);
    meshStale(mirror, new Map());
    mirror.apply({ ...all, keyframe: false });
    expect(mirror.staleBricks).toBe(0);
  });

  it("calls only the brick itself stale when the change is out of its neighbours' sight", () => {
    const mirror = new ClayMirror();
    mirror.apply(message([3, 3, 3], () => 255));
    meshStale(mirror, new Map());
    const hole = new Uint8Array(4096).fill(255);
    hole[8 + 16 * (8 + 16 * 8)] = 0;
    mirror.apply({ ...message([3, 3, 3], () => 255), keyframe: false, bricks: [{ index: 13, content: hole }] });
    expect(mirror.staleBricks).toBe(1);
    expect(mirror.takeStale()).toBe(13);
  });

  it("refuses a grid that no page can hold", () => {
    const mirror = new ClayMirror();
    expect(() => mirror.apply({ ...message([1, 1, 1], () => 0), bricks_per_axis: [65535, 65535, 65535] })).toThrow(RangeError);
    expect(mirror.apply(message([1, 1, 1], () => 255))).toBe(true);
  });

  it("forgets what it held when a keyframe comes, and says when the grid is another one", () => {
    const mirror = new ClayMirror();
    expect(mirror.apply(message([2, 2, 2], () => 255))).toBe(true);
    meshStale(mirror, new Map());
    expect(mirror.apply({ ...message([2, 2, 2], () => 255), bricks: [] })).toBe(false);
    expect(mirror.staleBricks).toBe(8);
    expect(survey(meshStale(mirror, new Map())).triangles).toBe(0);
    expect(mirror.apply(message([2, 2, 3], () => 255))).toBe(true);
  });
});

/** Coverage of a voxel whose centre lies `depth` voxels inside the clay. */
function band(depth: number): number {
  return Math.round(255 * Math.min(Math.max(0.5 + depth / 2, 0), 1));
}

const block = (x: number, y: number, z: number): number =>
  Math.min(x, y, z) < 3 || 45 < Math.max(x, y, z) ? 0 : 255;

const cuts: Record<"along" | "across" | "diagonal" | "through", Field> = {
  along: (x, y, z) => Math.min(block(x, y, z), band(Math.hypot(y - 20.4, z - 43) - 7.3)),
  across: (x, y, z) => Math.min(block(x, y, z), band(Math.hypot(x - 16, z - 45) - 9.1)),
  diagonal: (x, y, z) => Math.min(block(x, y, z), band(Math.hypot((x - y) / Math.SQRT2, z - 40) - 6.2)),
  through: (x, y, z) => Math.min(block(x, y, z), band(Math.abs(x + 0.7 * y - 40) / 1.22 - 3)),
};

/** The occupied volume, voxels, at the isolevel: fine steps of `field` as a solid. */
function occupied(field: Field, edge: number): number {
  let sum = 0;
  for (let z = 0; z < edge; z += 1) {
    for (let y = 0; y < edge; y += 1) {
      for (let x = 0; x < edge; x += 1) sum += field(x + 0.5, y + 0.5, z + 0.5) / 255;
    }
  }
  return sum;
}

function message(perAxis: [number, number, number], field: Field): BricksMessage {
  const bricks: BrickUpdate[] = [];
  const [nx, ny, nz] = perAxis;
  for (let index = 0; index < nx * ny * nz; index += 1) {
    const [x, y, z] = [index % nx, Math.floor(index / nx) % ny, Math.floor(index / (nx * ny))];
    const voxels = new Uint8Array(4096);
    for (let i = 0; i < 4096; i += 1) {
      voxels[i] = field(16 * x + (i & 15) + 0.5, 16 * y + ((i >> 4) & 15) + 0.5, 16 * z + (i >> 8) + 0.5);
    }
    const uniform = voxels.every((v) => v === voxels[0]) && (voxels[0] === 0 || voxels[0] === 255);
    bricks.push({ index, content: uniform ? (voxels[0] === 0 ? "empty" : "full") : voxels });
  }
  return { sequence: 0, clay_epoch: 1, bricks_per_axis: perAxis, keyframe: true, voxel_size_m: 5e-4, bricks };
}

function fill(perAxis: [number, number, number], field: Field): ClayMirror {
  const mirror = new ClayMirror();
  mirror.apply(message(perAxis, field));
  return mirror;
}

const meshAll = (mirror: ClayMirror): Map<number, BrickMesh> => meshStale(mirror, new Map<number, BrickMesh>());

function meshStale(mirror: ClayMirror, meshes: Map<number, BrickMesh>): Map<number, BrickMesh> {
  const around = new Neighbourhood();
  const finder = new SurfaceFinder();
  for (let index = mirror.takeStale(); index !== undefined; index = mirror.takeStale()) {
    meshes.delete(index);
    if (!around.fill(mirror, index)) continue;
    const at = mirror.coordinates(index);
    const mesh = finder.find(around, [16 * at[0], 16 * at[1], 16 * at[2]], [at[0] === 0, at[1] === 0, at[2] === 0]);
    if (0 < mesh.indices.length) meshes.set(index, mesh);
  }
  return meshes;
}

/** Edges without their opposite, taking vertices at the same place for the same; the volume enclosed; the triangles. */
function survey(meshes: Map<number, BrickMesh>): { open: number; volume: number; triangles: number } {
  const edges = new Map<string, number>();
  let [volume, triangles] = [0, 0];
  for (const { positions, indices } of meshes.values()) {
    for (let t = 0; t < indices.length; t += 3) {
      const corners = [0, 1, 2].map((i) => [...positions.subarray(3 * indices[t + i], 3 * indices[t + i] + 3)]);
      const [p, q, r] = corners;
      volume += (p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) + p[2] * (q[0] * r[1] - q[1] * r[0])) / 6;
      triangles += 1;
      for (let i = 0; i < 3; i += 1) {
        const [from, to] = [corners[i].join(), corners[(i + 1) % 3].join()];
        if (from === to) continue;
        edges.set(`${from}>${to}`, (edges.get(`${from}>${to}`) ?? 0) + 1);
        edges.set(`${to}>${from}`, (edges.get(`${to}>${from}`) ?? 0) - 1);
      }
    }
  }
  const open = [...edges.values()].filter((n) => n !== 0).length;
  return { open, volume, triangles };
}
