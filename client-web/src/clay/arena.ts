// All brick meshes in one set of buffers, so that the whole clay is one draw call and a cut uploads only what it
// touched.

import { type Facing, facingOf, isTurnedAway } from "./facing";
import { Ranges } from "./ranges";
import type { BrickMesh } from "../protocol/module";

/** A stretch of a buffer to upload, in elements. */
export interface Stretch {
  readonly start: number;
  readonly count: number;
}

interface Placed {
  readonly firstVertex: number;
  readonly vertices: number;
  readonly firstTriangle: number;
  readonly triangles: number;
  readonly facing: Facing;
}

export class MeshArena {
  positions = new Float32Array(0);
  facing = new Int8Array(0);
  indices = new Uint32Array(0);
  #vertices = new Ranges();
  #triangles = new Ranges();
  #placed = new Map<number, Placed>();
  #vertexStretches: Stretch[] = [];
  #indexStretches: Stretch[] = [];
  #grown = false;

  /** Indices to draw; the gaps between meshes hold triangles without area. */
  get drawCount(): number {
    return 3 * this.#triangles.end;
  }

  get triangles(): number {
    let sum = 0;
    for (const { triangles } of this.#placed.values()) sum += triangles;
    return sum;
  }

  /** Puts a brick's mesh in the place of the one it had. */
  replace(brick: number, mesh: BrickMesh | undefined): void {
    this.#remove(brick);
    if (mesh === undefined || mesh.indices.length === 0) return;
    const [vertices, triangles] = [mesh.positions.length / 3, mesh.indices.length / 3];
    const placed = {
      firstVertex: this.#vertices.take(vertices), vertices,
      firstTriangle: this.#triangles.take(triangles), triangles,
      facing: facingOf(mesh),
    };
    this.#makeRoom();
    this.positions.set(mesh.positions, 3 * placed.firstVertex);
    this.facing.set(mesh.facing, 4 * placed.firstVertex);
    const first = 3 * placed.firstTriangle;
    for (let i = 0; i < 3 * triangles; i += 1) this.indices[first + i] = mesh.indices[i] + placed.firstVertex;
    this.#placed.set(brick, placed);
    this.#vertexStretches.push({ start: placed.firstVertex, count: vertices });
    this.#indexStretches.push({ start: first, count: 3 * triangles });
  }

  /**
   * Writes the indices of the bricks of which an eye at a place can see anything, of all of them where there is no eye;
   * returns how many indices these are. `into` has room for all.
   */
  writeSeen(eye: readonly [number, number, number] | undefined, into: Uint32Array): number {
    let count = 0;
    for (const { firstTriangle, triangles, facing } of this.#placed.values()) {
      if (eye !== undefined && isTurnedAway(facing, eye)) continue;
      into.set(this.indices.subarray(3 * firstTriangle, 3 * (firstTriangle + triangles)), count);
      count += 3 * triangles;
    }
    return count;
  }

  clear(): void {
    this.#vertices = new Ranges();
    this.#triangles = new Ranges();
    this.#placed.clear();
    this.indices.fill(0);
    this.#grown = true;
  }

  /** What changed since the last call; `grown` means that the buffers are other ones, to be uploaded whole. */
  takeChanges(): { grown: boolean; vertices: Stretch[]; indices: Stretch[] } {
    const changes = { grown: this.#grown, vertices: this.#vertexStretches, indices: this.#indexStretches };
    this.#grown = false;
    this.#vertexStretches = [];
    this.#indexStretches = [];
    return changes;
  }

  #remove(brick: number): void {
    const placed = this.#placed.get(brick);
    if (placed === undefined) return;
    this.#placed.delete(brick);
    this.#vertices.giveBack(placed.firstVertex, placed.vertices);
    this.#triangles.giveBack(placed.firstTriangle, placed.triangles);
    const [start, count] = [3 * placed.firstTriangle, 3 * placed.triangles];
    this.indices.fill(0, start, start + count);
    this.#indexStretches.push({ start, count });
  }

  #makeRoom(): void {
    if (this.positions.length < 3 * this.#vertices.end) {
      const vertices = Math.max(2 * this.#vertices.end, 1 << 14);
      this.positions = grown(this.positions, new Float32Array(3 * vertices));
      this.facing = grown(this.facing, new Int8Array(4 * vertices));
      this.#grown = true;
    }
    if (this.indices.length < this.drawCount) {
      this.indices = grown(this.indices, new Uint32Array(Math.max(2 * this.drawCount, 3 << 14)));
      this.#grown = true;
    }
  }
}

function grown<T extends Float32Array | Int8Array | Uint32Array>(from: T, to: T): T {
  to.set(from);
  return to;
}
