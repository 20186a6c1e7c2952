// The clay in the scene: one mesh, its buffers, and the coarse occupancy that its shading looks up.

import * as THREE from "three";
import { MeshArena, type Stretch } from "../clay/arena";
import { COARSE_EDGE, type Meshes } from "../clay/port";
import type { Vector } from "../protocol/session";
import { type Block, type ClayMaterial, clayMaterial } from "./clay_material";
import { occupancyTexture, putOccupancy } from "./occupancy";
import type { Quality } from "./quality";

const MM_PER_M = 1000;

/** The block on show, as it was when it was fresh: metres, in the clay's frame. */
export interface BlockDescription {
  readonly size_m: Vector;
  /** Heights of its level faces, and where its steps stand along x. */
  readonly heights_m: readonly number[];
  readonly steps_m: readonly number[];
}

export class ClayMesh {
  readonly mesh: THREE.Mesh;
  readonly #arena = new MeshArena();
  readonly #look: ClayMaterial;
  #positions: THREE.BufferAttribute | undefined;
  #facing: THREE.InterleavedBuffer | undefined;
  #indices: THREE.BufferAttribute | undefined;
  #occupancy = occupancyTexture([0, 0, 0]);
  #bricksPerAxis: readonly [number, number, number] = [0, 0, 0];
  /** Of the mesh, which may be coarser than the clay; 0 before the first. */
  #voxel_size_m = 0;
  #block: BlockDescription | undefined;
  /** Where vertices are dear, bricks that nobody can see are left out: as they were seen from here last. */
  readonly #sparesVertices: boolean;
  #eye: THREE.Vector3 | "everywhere" | undefined;

  constructor(quality: Quality) {
    this.#sparesVertices = quality === "plain";
    this.#look = clayMaterial(quality);
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), this.#look.material);
    this.mesh.castShadow = true;
    this.mesh.receiveShadow = true;
    // Always in view; and its bounds change with every cut.
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.#look.setOccupancy(this.#occupancy);
  }

  get triangles(): number {
    return this.#arena.triangles;
  }

  apply(update: Meshes): void {
    if (update.regridded) this.#regrid(update);
    for (const { index, mesh, coarse } of update.bricks) {
      this.#arena.replace(index, mesh);
      this.#putCoarse(index, coarse);
    }
    this.#occupancy.needsUpdate = true;
    this.#upload();
  }

  /** To be called before a frame: `eye`, mm, sees it; nothing: all of it is drawn, as shadows are cast by all of it. */
  lookFrom(eye: THREE.Vector3 | undefined): void {
    if (!this.#sparesVertices || this.#indices === undefined) return;
    const isSame = eye === undefined ? this.#eye === "everywhere" : this.#eye instanceof THREE.Vector3 && this.#eye.equals(eye);
    if (isSame) return;
    this.#eye = eye?.clone() ?? "everywhere";
    const { array } = this.#indices;
    if (!(array instanceof Uint32Array)) return;
    const scale = this.mesh.scale.x;
    const count = this.#arena.writeSeen(eye === undefined ? undefined : [eye.x / scale, eye.y / scale, eye.z / scale], array);
    this.#indices.clearUpdateRanges();
    this.#indices.addUpdateRange(0, count);
    this.#indices.needsUpdate = true;
    this.mesh.geometry.setDrawRange(0, count);
  }

  setBlock(block: BlockDescription): void {
    this.#block = block;
    this.#describe();
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.#look.dispose();
    this.#occupancy.dispose();
  }

  #regrid(update: Meshes): void {
    this.#arena.clear();
    this.#bricksPerAxis = update.bricks_per_axis;
    this.#occupancy.dispose();
    this.#occupancy = occupancyTexture(update.bricks_per_axis);
    this.#look.setOccupancy(this.#occupancy);
    this.#voxel_size_m = update.voxel_size_m;
    this.#describe();
    this.mesh.scale.setScalar(update.voxel_size_m * MM_PER_M);
    this.mesh.visible = true;
  }

  /** The material counts in the mesh's voxels. */
  #describe(): void {
    if (this.#block === undefined || this.#voxel_size_m === 0) return;
    this.#look.setBlock(inVoxels(this.#block, this.#voxel_size_m));
  }

  #putCoarse(index: number, coarse: Uint8Array): void {
    const [nx, ny] = this.#bricksPerAxis;
    const at = [index % nx, Math.floor(index / nx) % ny, Math.floor(index / (nx * ny))];
    const [x, y, z] = at.map((n) => n * COARSE_EDGE);
    putOccupancy(this.#occupancy, [x, y, z], [COARSE_EDGE, COARSE_EDGE, COARSE_EDGE], coarse);
  }

  #upload(): void {
    const { grown, vertices, indices } = this.#arena.takeChanges();
    if (grown) this.#rebuild();
    else {
      mark(this.#positions, vertices, 3);
      mark(this.#facing, vertices, 4);
      if (!this.#sparesVertices) mark(this.#indices, indices, 1);
    }
    this.#eye = undefined;
    if (!this.#sparesVertices) this.mesh.geometry.setDrawRange(0, this.#arena.drawCount);
  }

  /** The arena has other buffers now: so must the graphics card. */
  #rebuild(): void {
    this.mesh.geometry.dispose();
    this.#positions = new THREE.BufferAttribute(this.#arena.positions, 3);
    this.#facing = new THREE.InterleavedBuffer(this.#arena.facing, 4);
    this.#indices = new THREE.BufferAttribute(this.#sparesVertices ? new Uint32Array(this.#arena.indices.length) : this.#arena.indices, 1);
    for (const buffer of [this.#positions, this.#facing, this.#indices]) buffer.setUsage(THREE.DynamicDrawUsage);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", this.#positions);
    geometry.setAttribute("normal", new THREE.InterleavedBufferAttribute(this.#facing, 3, 0, true));
    geometry.setIndex(this.#indices);
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(), Number.POSITIVE_INFINITY);
    this.mesh.geometry = geometry;
  }
}

/** As the material counts. */
export function inVoxels({ size_m, heights_m, steps_m }: BlockDescription, voxel_size_m: number): Block {
  const voxels = (metres: number): number => metres / voxel_size_m;
  return { size: new THREE.Vector3(...size_m.map(voxels)), heights: heights_m.map(voxels), steps: steps_m.map(voxels) };
}

function mark(
  buffer: THREE.BufferAttribute | THREE.InterleavedBuffer | undefined,
  stretches: readonly Stretch[],
  width: number,
): void {
  if (buffer === undefined || stretches.length === 0) return;
  for (const { start, count } of stretches) buffer.addUpdateRange(start * width, count * width);
  buffer.needsUpdate = true;
}
