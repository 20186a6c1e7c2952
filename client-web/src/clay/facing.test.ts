import { describe, expect, it } from "vitest";
import type { BrickMesh } from "../protocol/module";
import { MeshArena } from "./arena";
import { facingOf, isTurnedAway } from "./facing";

type Place = readonly [number, number, number];

describe("a brick's facing", () => {
  it("leaves out no triangle that an eye would see, and most of what it would not", () => {
    const random = chance(11);
    let [hidden, away] = [0, 0];
    for (let round = 0; round < 400; round += 1) {
      const mesh = patch(random, 0.3 * random());
      const facing = facingOf(mesh);
      for (let n = 0; n < 20; n += 1) {
        const eye: Place = [60 * (random() - 0.5), 60 * (random() - 0.5), 60 * (random() - 0.5)];
        const isSeen = facesSeen(mesh, eye);
        if (!isSeen) away += 1;
        if (!isTurnedAway(facing, eye)) continue;
        hidden += 1;
        expect(isSeen).toBe(false);
      }
    }
    expect(hidden).toBeGreaterThan(0.5 * away);
    expect(hidden).toBeGreaterThan(1000);
  });

  it("is every way for a mesh that is closed", () => {
    const cube = closedCube();
    for (const eye of [[9, 0, 0], [0, -9, 3], [-5, 5, 5]] as const) expect(isTurnedAway(facingOf(cube), eye)).toBe(false);
  });

  it("decides what of the arena is drawn: the bricks that face the eye, all of them, once", () => {
    const arena = new MeshArena();
    const up = flat(1);
    const down = flat(-1);
    arena.replace(1, up);
    arena.replace(2, down);
    arena.replace(3, up);
    arena.replace(1, undefined);
    const into = new Uint32Array(arena.indices.length);
    expect(arena.writeSeen([0, 0, 50], into)).toBe(up.indices.length);
    expect(heights(arena, into, up.indices.length)).toEqual([1]);
    expect(arena.writeSeen([0, 0, -50], into)).toBe(down.indices.length);
    expect(heights(arena, into, down.indices.length)).toEqual([-1]);
    expect(arena.writeSeen(undefined, into)).toBe(up.indices.length + down.indices.length);
  });
});

/** Whether any triangle turns its front to the eye. */
function facesSeen({ positions, indices }: BrickMesh, eye: Place): boolean {
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((n) => [...positions.subarray(3 * indices[i + n], 3 * indices[i + n] + 3)]);
    const [u, v, w] = [b, c, [...eye]].map((to) => to.map((x, axis) => x - a[axis]));
    const volume = w[0] * (u[1] * v[2] - u[2] * v[1]) + w[1] * (u[2] * v[0] - u[0] * v[2]) + w[2] * (u[0] * v[1] - u[1] * v[0]);
    if (0 < volume) return true;
  }
  return false;
}

/** A patch of surface, so uneven, turned and moved anyhow. */
function patch(random: () => number, unevenness: number): BrickMesh {
  const edge = 4;
  const turn = [6.3 * random(), 6.3 * random()];
  const move = [20 * (random() - 0.5), 20 * (random() - 0.5), 20 * (random() - 0.5)];
  const positions: number[] = [];
  for (let n = 0; n < edge * edge; n += 1) {
    const [x, y, z] = [n % edge, Math.floor(n / edge), unevenness * (random() - 0.5)];
    const [x1, z1] = [x * Math.cos(turn[0]) - z * Math.sin(turn[0]), x * Math.sin(turn[0]) + z * Math.cos(turn[0])];
    positions.push(x1 + move[0], y * Math.cos(turn[1]) - z1 * Math.sin(turn[1]) + move[1], y * Math.sin(turn[1]) + z1 * Math.cos(turn[1]) + move[2]);
  }
  return meshOf(positions, grid(edge));
}

function grid(edge: number): number[] {
  const indices: number[] = [];
  for (let y = 0; y + 1 < edge; y += 1) {
    for (let x = 0; x + 1 < edge; x += 1) {
      const at = y * edge + x;
      indices.push(at, at + 1, at + edge, at + 1, at + edge + 1, at + edge);
    }
  }
  return indices;
}

/** A level square at a height of 1 or −1, facing away from the ground. */
function flat(side: 1 | -1): BrickMesh {
  const positions = [0, 0, side, 1, 0, side, 0, 1, side, 1, 1, side];
  return meshOf(positions, side === 1 ? [0, 1, 2, 1, 3, 2] : [0, 2, 1, 1, 2, 3]);
}

function closedCube(): BrickMesh {
  const positions = Array.from({ length: 8 }, (_, n) => [n & 1, (n >> 1) & 1, n >> 2]).flat();
  const faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  return meshOf(positions, faces.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]));
}

function meshOf(positions: readonly number[], indices: readonly number[]): BrickMesh {
  return {
    positions: Float32Array.from(positions), indices: Uint16Array.from(indices),
    facing: new Int8Array((4 * positions.length) / 3),
  };
}

function heights(arena: MeshArena, indices: Uint32Array, count: number): number[] {
  return [...new Set([...indices.subarray(0, count)].map((vertex) => arena.positions[3 * vertex + 2]))];
}

/** Numbers from 0 to 1 that are the same on every run. */
function chance(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1_664_525) + 1_013_904_223) >>> 0;
    return state / 2 ** 32;
  };
}
