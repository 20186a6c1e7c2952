// The clay's surface, brick by brick, as naive surface nets over occupancy.
//
// A vertex sits in every cell of eight voxel centres that the surface crosses, a quad around every edge between two
// centres that it crosses. A brick owns the edges that start at its voxels; the vertices around them lie in cells -1 …
// 15, so neighbours find the same vertices from the same voxels and the meshes meet without a crack.
//
// An untouched flat face, 512 triangles a brick, is drawn as a fan over its rim: the rim keeps every vertex, so nothing
// opens towards a neighbour that is cut.

import { BRICK_EDGE } from "../protocol/packing";
import { Cell, ISOLEVEL } from "./cell";
import { LAYER, type Neighbourhood, ORIGIN, ROW } from "./neighbourhood";

export interface BrickMesh {
  /** Three per vertex, voxels from the low corner of the grid. */
  readonly positions: Float32Array<ArrayBuffer>;
  /** Four per vertex: the outward normal scaled to 127, and a zero that keeps vertices on four bytes. */
  readonly facing: Int8Array<ArrayBuffer>;
  /** Three per triangle, counter-clockwise seen from the air. */
  readonly indices: Uint16Array<ArrayBuffer>;
}

/** Which of a brick's low sides are the grid's own: edges from the air outside are then the brick's. */
export type LowSides = readonly [boolean, boolean, boolean];

const CELLS = BRICK_EDGE + 1;
/** If every edge that a brick can own crossed the surface. */
const MOST_QUADS = 3 * CELLS * BRICK_EDGE * BRICK_EDGE;
const STRIDE = [1, ROW, LAYER] as const;
/** The cell in the middle of a layer. */
const MIDDLE = 7;
const UNSOLVED = -2;
const SOLVED = -1;

/** Finds surfaces; holds only working memory, reused from brick to brick. */
export class SurfaceFinder {
  readonly #cell = new Cell();
  readonly #state = new Int16Array(CELLS ** 3);
  readonly #solved = new Float32Array(6 * CELLS ** 3);
  readonly #signs = new Int8Array(BRICK_EDGE * BRICK_EDGE);
  readonly #positions = new Float32Array(3 * CELLS ** 3);
  readonly #facing = new Int8Array(4 * CELLS ** 3);
  readonly #indices = new Uint16Array(6 * MOST_QUADS);
  #vertexCount = 0;
  #indexCount = 0;
  #voxels = new Uint8Array(0);
  #corner: readonly number[] = [0, 0, 0];

  /** The mesh of the brick in `around`, whose low corner is the grid's voxel `corner`. */
  find(around: Neighbourhood, corner: readonly [number, number, number], low: LowSides): BrickMesh {
    this.#voxels = around.voxels;
    this.#corner = corner;
    this.#state.fill(UNSOLVED);
    this.#vertexCount = 0;
    this.#indexCount = 0;
    for (let axis = 0; axis < 3; axis += 1) {
      for (let layer = low[axis] ? -1 : 0; layer < BRICK_EDGE; layer += 1) this.#addLayer(axis, layer);
    }
    return {
      positions: this.#positions.slice(0, 3 * this.#vertexCount),
      facing: this.#facing.slice(0, 4 * this.#vertexCount),
      indices: this.#indices.slice(0, this.#indexCount),
    };
  }

  /** The quads around all edges from voxel `layer` to the next one up `axis`. */
  #addLayer(axis: number, layer: number): void {
    const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    const start = ORIGIN + layer * STRIDE[axis];
    const [along, across, up] = [STRIDE[u], STRIDE[v], STRIDE[axis]];
    let ups = 0;
    let downs = 0;
    for (let b = 0; b < BRICK_EDGE; b += 1) {
      for (let a = 0; a < BRICK_EDGE; a += 1) {
        const at = start + a * along + b * across;
        const inside = ISOLEVEL < this.#voxels[at] ? 1 : 0;
        const sign = inside - (ISOLEVEL < this.#voxels[at + up] ? 1 : 0);
        this.#signs[a + BRICK_EDGE * b] = sign;
        if (0 < sign) ups += 1;
        if (sign < 0) downs += 1;
      }
    }
    if (ups + downs === 0) return;
    const face = { axis, u, v, layer };
    const whole = ups === this.#signs.length || downs === this.#signs.length;
    if (whole && this.#addFlat(face, this.#signs[0])) return;
    for (let b = 0; b < BRICK_EDGE; b += 1) {
      for (let a = 0; a < BRICK_EDGE; a += 1) {
        const sign = this.#signs[a + BRICK_EDGE * b];
        if (sign !== 0) this.#addQuad(face, a, b, sign);
      }
    }
  }

  #addQuad(face: Face, a: number, b: number, sign: number): void {
    const corners = [
      this.#vertex(face, a - 1, b - 1), this.#vertex(face, a, b - 1),
      this.#vertex(face, a, b), this.#vertex(face, a - 1, b),
    ];
    // Split along the shorter diagonal: the longer one would dent ridges.
    const turned = this.#distance(corners[1], corners[3]) < this.#distance(corners[0], corners[2]);
    const [p, q, r, s] = turned ? [corners[1], corners[2], corners[3], corners[0]] : corners;
    this.#addTriangle(p, q, r, sign);
    this.#addTriangle(p, r, s, sign);
  }

  /** Draws the flat part of a whole layer as a fan, if that is worth it; returns whether it did. */
  #addFlat(face: Face, sign: number): boolean {
    const flat = this.#flatPart(face);
    if (flat === undefined) return false;
    const { a0, a1, b0, b1 } = flat;
    const centre = this.#vertex(face, MIDDLE, MIDDLE);
    const rim: number[] = [];
    for (let a = a0; a < a1; a += 1) rim.push(this.#vertex(face, a, b0));
    for (let b = b0; b < b1; b += 1) rim.push(this.#vertex(face, a1, b));
    for (let a = a1; a0 < a; a -= 1) rim.push(this.#vertex(face, a, b1));
    for (let b = b1; b0 < b; b -= 1) rim.push(this.#vertex(face, a0, b));
    rim.forEach((vertex, n) => this.#addTriangle(centre, vertex, rim[(n + 1) % rim.length], sign));
    for (let b = 0; b < BRICK_EDGE; b += 1) {
      for (let a = 0; a < BRICK_EDGE; a += 1) {
        const inFan = a0 < a && a <= a1 && b0 < b && b <= b1;
        if (!inFan) this.#addQuad(face, a, b, sign);
      }
    }
    return true;
  }

  /**
   * The rectangle of vertices around the middle that lie in one plane and face straight out. Its sides are read
   * off the middle row and column: where the block ends, the last few vertices bend.
   */
  #flatPart(face: Face): Rectangle | undefined {
    if (!this.#isFlat(face, MIDDLE, MIDDLE)) return undefined;
    let [a0, a1, b0, b1] = [MIDDLE, MIDDLE, MIDDLE, MIDDLE];
    while (-1 < a0 && this.#isFlat(face, a0 - 1, MIDDLE)) a0 -= 1;
    while (a1 < BRICK_EDGE - 1 && this.#isFlat(face, a1 + 1, MIDDLE)) a1 += 1;
    while (-1 < b0 && this.#isFlat(face, MIDDLE, b0 - 1)) b0 -= 1;
    while (b1 < BRICK_EDGE - 1 && this.#isFlat(face, MIDDLE, b1 + 1)) b1 += 1;
    if (a0 === MIDDLE || a1 === MIDDLE || b0 === MIDDLE || b1 === MIDDLE) return undefined;
    for (let b = b0; b <= b1; b += 1) {
      for (let a = a0; a <= a1; a += 1) if (!this.#isFlat(face, a, b)) return undefined;
    }
    return { a0, a1, b0, b1 };
  }

  /**
   * Whether a vertex lies in the same plane as the one in the middle, in the middle of its cell, and faces straight
   * out.
   */
  #isFlat(face: Face, a: number, b: number): boolean {
    const at = 6 * this.#solve(face, a, b);
    const middle = 6 * this.#solve(face, MIDDLE, MIDDLE);
    return this.#solved[at + face.axis] === this.#solved[middle + face.axis] &&
      this.#solved[at + face.u] === a + 1 &&
      this.#solved[at + face.v] === b + 1 &&
      0.9999 < Math.abs(this.#solved[at + 3 + face.axis]);
  }

  #addTriangle(p: number, q: number, r: number, sign: number): void {
    this.#indices[this.#indexCount] = p;
    this.#indices[this.#indexCount + 1] = 0 < sign ? q : r;
    this.#indices[this.#indexCount + 2] = 0 < sign ? r : q;
    this.#indexCount += 3;
  }

  /** The output index of the vertex in the cell at (a, b) of a layer. */
  #vertex(face: Face, a: number, b: number): number {
    const cell = this.#solve(face, a, b);
    if (this.#state[cell] !== SOLVED) return this.#state[cell];
    const index = this.#vertexCount;
    this.#vertexCount += 1;
    this.#state[cell] = index;
    for (let i = 0; i < 3; i += 1) {
      this.#positions[3 * index + i] = this.#solved[6 * cell + i] + this.#corner[i];
      this.#facing[4 * index + i] = Math.round(127 * this.#solved[6 * cell + 3 + i]);
    }
    return index;
  }

  /** Finds the vertex of a cell unless that was done already; returns the cell's place in the working memory. */
  #solve(face: Face, a: number, b: number): number {
    const { axis, layer } = face;
    const x = axis === 0 ? layer : axis === 1 ? b : a;
    const y = axis === 1 ? layer : axis === 2 ? b : a;
    const z = axis === 2 ? layer : axis === 0 ? b : a;
    const cell = x + 1 + CELLS * (y + 1 + CELLS * (z + 1));
    if (this.#state[cell] !== UNSOLVED) return cell;
    this.#cell.solve(this.#voxels, x, y, z);
    this.#solved.set(this.#cell.position, 6 * cell);
    this.#solved.set(this.#cell.normal, 6 * cell + 3);
    this.#state[cell] = SOLVED;
    return cell;
  }

  #distance(p: number, q: number): number {
    const x = this.#positions[3 * p] - this.#positions[3 * q];
    const y = this.#positions[3 * p + 1] - this.#positions[3 * q + 1];
    const z = this.#positions[3 * p + 2] - this.#positions[3 * q + 2];
    return x * x + y * y + z * z;
  }
}

/** A layer of edges along `axis`; `u` and `v` span it, in the order that makes a right-handed triple. */
interface Face {
  readonly axis: number;
  readonly u: number;
  readonly v: number;
  readonly layer: number;
}

interface Rectangle {
  readonly a0: number;
  readonly a1: number;
  readonly b0: number;
  readonly b1: number;
}
