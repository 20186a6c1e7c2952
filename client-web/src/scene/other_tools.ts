// The tools that others hold in the same clay: where they are, and no more. All have the shape of the tool on show.

import * as THREE from "three";
import type { Vector } from "../protocol/session";
import { partsOf, type ToolSize } from "./tool_model";

const MM_PER_M = 1000;

export class OtherTools {
  readonly group = new THREE.Group();
  /** Paler than the tool on show, so that nobody takes one for the other. */
  readonly #material = new THREE.MeshLambertMaterial({ color: 0xaab2bc, transparent: true, opacity: 0.7 });
  #geometries: readonly THREE.BufferGeometry[] = [];

  get count(): number {
    return this.group.children.filter(({ visible }) => visible).length;
  }

  setSize(size: ToolSize): void {
    for (const geometry of this.#geometries) geometry.dispose();
    const { body, shaft } = partsOf(size);
    this.#geometries = [body, shaft];
    const { length } = this.group.children;
    this.group.clear();
    for (let n = 0; n < length; n += 1) this.#add();
  }

  /** One tool at each of the places, m. */
  place(places_m: readonly Vector[]): void {
    while (this.group.children.length < places_m.length) this.#add();
    this.group.children.forEach((tool, n) => {
      tool.visible = n < places_m.length;
      if (tool.visible) tool.position.set(...places_m[n]).multiplyScalar(MM_PER_M);
    });
  }

  dispose(): void {
    for (const geometry of this.#geometries) geometry.dispose();
    this.#material.dispose();
  }

  #add(): void {
    const tool = new THREE.Group();
    tool.visible = false;
    for (const geometry of this.#geometries) {
      const mesh = new THREE.Mesh(geometry, this.#material);
      mesh.castShadow = true;
      tool.add(mesh);
    }
    this.group.add(tool);
  }
}
