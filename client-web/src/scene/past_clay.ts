// The clay of another moment in the scene: a mesh that comes whole and stays as it is, and looks as the present one
// does.

import * as THREE from "three";
import type { PastMesh } from "../clay/past_mesh";
import { COARSE_EDGE } from "../clay/port";
import { type BlockDescription, inVoxels } from "./clay_mesh";
import { type ClayMaterial, clayMaterial } from "./clay_material";
import { occupancyTexture, putOccupancy } from "./occupancy";
import type { Quality } from "./quality";

const MM_PER_M = 1000;

export class PastClay {
  readonly mesh: THREE.Mesh;
  readonly #look: ClayMaterial;
  #occupancy = occupancyTexture([0, 0, 0]);
  #block: BlockDescription | undefined;
  #voxel_size_m = 0;

  constructor(quality: Quality) {
    this.#look = clayMaterial(quality);
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), this.#look.material);
    this.mesh.castShadow = true;
    this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.#look.setOccupancy(this.#occupancy);
  }

  get isShown(): boolean {
    return this.mesh.visible;
  }

  get triangles(): number {
    return (this.mesh.geometry.index?.count ?? 0) / 3;
  }

  show(past: PastMesh): void {
    this.#renew(past.bricks_per_axis);
    const [nx, ny, nz] = past.bricks_per_axis.map((bricks) => bricks * COARSE_EDGE);
    putOccupancy(this.#occupancy, [0, 0, 0], [nx, ny, nz], past.coarse);
    const geometry = this.mesh.geometry;
    geometry.setAttribute("position", new THREE.BufferAttribute(past.positions, 3));
    const facing = new THREE.InterleavedBuffer(past.facing, 4);
    geometry.setAttribute("normal", new THREE.InterleavedBufferAttribute(facing, 3, 0, true));
    geometry.setIndex(new THREE.BufferAttribute(past.indices, 1));
    this.#voxel_size_m = past.voxel_size_m;
    this.mesh.scale.setScalar(past.voxel_size_m * MM_PER_M);
    this.#describe();
    this.mesh.visible = true;
  }

  hide(): void {
    this.#renew([0, 0, 0]);
    this.mesh.visible = false;
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

  /** Gives what the graphics card held back to it. */
  #renew(bricks_per_axis: readonly [number, number, number]): void {
    this.mesh.geometry.dispose();
    this.mesh.geometry = new THREE.BufferGeometry();
    this.#occupancy.dispose();
    this.#occupancy = occupancyTexture(bricks_per_axis);
    this.#look.setOccupancy(this.#occupancy);
  }

  #describe(): void {
    if (this.#block !== undefined && this.#voxel_size_m !== 0) this.#look.setBlock(inVoxels(this.#block, this.#voxel_size_m));
  }
}
