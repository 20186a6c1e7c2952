import * as THREE from "three";
import { describe, expect, it } from "vitest";
import { gridOf, type PastMesh, pastMeshOf } from "./past_mesh";

const VOXEL_M = 5e-4;
const MM = 1e-3;

/** A box of triangles as three.js makes them, `pieces` to an edge, or two to a face. Millimetres. */
function box(size: readonly [number, number, number], corner: readonly [number, number, number], pieces: number): THREE.BufferGeometry {
  const geometry = new THREE.BoxGeometry(...size, pieces, pieces, pieces);
  return geometry.translate(corner[0] + size[0] / 2, corner[1] + size[1] / 2, corner[2] + size[2] / 2);
}

function meshOf(...boxes: THREE.BufferGeometry[]): PastMesh {
  const positions: number[] = [];
  const indices: number[] = [];
  for (const geometry of boxes) {
    const first = positions.length / 3;
    positions.push(...Array.from(geometry.getAttribute("position").array, (mm) => mm * MM));
    indices.push(...Array.from(geometry.index?.array ?? [], (n) => n + first));
  }
  return pastMeshOf({ positions: new Float32Array(positions), indices: new Uint32Array(indices) }, gridOf([0.064, 0.032, 0.032], VOXEL_M));
}

/** The same box inside out: air in clay. */
function hollow(geometry: THREE.BufferGeometry): THREE.BufferGeometry {
  const index = geometry.index?.array ?? [];
  return geometry.setIndex(Array.from(index, (_, n) => index[n - (n % 3) + [0, 2, 1][n % 3]]));
}

/** Occupancy of a cell of 2 mm, 0 … 255. */
function at({ coarse, bricks_per_axis: [bx, by] }: PastMesh, x_mm: number, y_mm: number, z_mm: number): number {
  const [i, j, k] = [x_mm, y_mm, z_mm].map((mm) => Math.floor(mm / 2));
  return coarse[i + 4 * bx * (j + 4 * by * k)];
}

/** Clay in all cells, mm³. */
const volumeOf = ({ coarse }: PastMesh): number => coarse.reduce((sum, cell) => sum + (8 * cell) / 255, 0);

describe("a mesh of the past", () => {
  it("lies in the grid that the server's clay lies in", () => {
    expect(gridOf([0.128, 0.064, 0.064], VOXEL_M).bricks_per_axis).toEqual([16, 8, 8]);
    expect(gridOf([0.128, 0.128, 0.064], VOXEL_M).bricks_per_axis).toEqual([16, 16, 8]);
    expect(gridOf([0.0081, 0.008, 0.0001], VOXEL_M).bricks_per_axis).toEqual([2, 1, 1]);
    // 0.3 / 0.1 is a little below 3, and 0.6 / 0.2 too: neither is another voxel.
    expect(gridOf([1.6, 0.3, 4.8], 0.1).bricks_per_axis).toEqual([1, 1, 3]);
  });

  it("knows how full every cell is: a whole block, whether of two triangles a face or of many", () => {
    for (const pieces of [1, 3, 16]) {
      const mesh = meshOf(box([64, 32, 32], [0, 0, 0], pieces));
      expect(mesh.coarse).toHaveLength(32 * 16 * 16);
      // Pieces that fit no cell count for the one that their centre stands in: what one lacks its neighbour has too
      // much.
      expect(mesh.coarse.filter((cell) => cell < 180)).toHaveLength(0);
      expect(volumeOf(mesh) / (64 * 32 * 32)).toBeGreaterThan(0.97);
    }
  });

  it("knows what was cut: a pit from above, and a hollow within", () => {
    const pit = meshOf(box([64, 32, 16], [0, 0, 0], 16), box([32, 32, 16], [32, 0, 16], 8));
    expect([at(pit, 5, 5, 20), at(pit, 5, 5, 10), at(pit, 45, 5, 20), at(pit, 45, 5, 10)]).toEqual([0, 255, 255, 255]);
    const hole = meshOf(box([64, 32, 32], [0, 0, 0], 8), hollow(box([16, 16, 16], [24, 8, 8], 8)));
    expect([at(hole, 31, 15, 15), at(hole, 31, 15, 5), at(hole, 31, 15, 25), at(hole, 5, 15, 15)]).toEqual([0, 255, 255, 255]);
  });

  it("counts parts of cells: half a cell's height is half of it", () => {
    const mesh = meshOf(box([64, 32, 31], [0, 0, 0], 16));
    expect(at(mesh, 33, 17, 31)).toBeGreaterThan(120);
    expect(at(mesh, 33, 17, 31)).toBeLessThan(135);
  });

  it("has the clay's volume, for a ball that fits no cell", () => {
    const radius = 13.3;
    const ball = new THREE.SphereGeometry(radius, 96, 64).translate(30.7, 16.1, 15.9);
    expect(volumeOf(meshOf(ball)) / ((4 / 3) * Math.PI * radius ** 3)).toBeCloseTo(1, 1);
  });

  it("faces outwards: along the radius all over a ball", () => {
    const centre = [32, 16, 16];
    const ball = new THREE.IcosahedronGeometry(12, 3);
    // Vertices of an icosahedron of three.js are not shared; by place they are.
    const places = new Map<string, number>();
    const corners: number[] = [];
    const array = ball.getAttribute("position").array;
    const indices = Array.from({ length: array.length / 3 }, (_, n) => {
      const place = [0, 1, 2].map((axis) => array[3 * n + axis] + centre[axis]);
      const key = place.map((mm) => mm.toFixed(4)).join();
      const known = places.get(key) ?? places.size;
      if (known === places.size) {
        places.set(key, known);
        corners.push(...place.map((mm) => mm * MM));
      }
      return known;
    });
    const mesh = pastMeshOf({ positions: new Float32Array(corners), indices: new Uint32Array(indices) }, gridOf([0.064, 0.032, 0.032], VOXEL_M));
    for (let n = 0; n < places.size; n += 1) {
      const radius = [0, 1, 2].map((axis) => mesh.positions[3 * n + axis] - 2 * centre[axis]);
      const length = Math.hypot(...radius);
      expect(length).toBeCloseTo(24, 2);
      const along = [0, 1, 2].reduce((sum, axis) => sum + (mesh.facing[4 * n + axis] / 127) * (radius[axis] / length), 0);
      expect(along).toBeGreaterThan(0.99);
    }
  });

  it("is nothing where no clay is left", () => {
    const mesh = meshOf();
    expect([mesh.positions.length, mesh.indices.length, Math.max(...mesh.coarse)]).toEqual([0, 0, 0]);
  });
});
