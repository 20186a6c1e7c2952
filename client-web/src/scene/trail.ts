// Where the tool has been in the last seconds: a line that fades towards the past.

import * as THREE from "three";

const MOST_POINTS = 512;

export class Trail {
  readonly line: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  readonly #positions = new THREE.BufferAttribute(new Float32Array(3 * MOST_POINTS), 3);
  readonly #colours = new THREE.BufferAttribute(new Float32Array(4 * MOST_POINTS), 4);
  readonly #colour = new THREE.Color();

  constructor() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", this.#positions);
    geometry.setAttribute("color", this.#colours);
    this.line = new THREE.Line(geometry, new THREE.LineBasicMaterial({
      vertexColors: true, transparent: true, depthWrite: false, toneMapped: false,
    }));
    this.line.frustumCulled = false;
  }

  setColour(colour: string): void {
    this.#colour.set(colour);
  }

  /** x, y, z in m one after the other, oldest first; each is lifted by `lift_mm`. */
  set(points_m: readonly number[], lift_mm: number): void {
    const count = Math.min(points_m.length / 3, MOST_POINTS);
    const skip = points_m.length - 3 * count;
    for (let n = 0; n < count; n += 1) {
      const at = skip + 3 * n;
      this.#positions.setXYZ(n, 1000 * points_m[at], 1000 * points_m[at + 1], 1000 * points_m[at + 2] + lift_mm);
      const age = 1 - n / Math.max(count - 1, 1);
      this.#colours.setXYZW(n, this.#colour.r, this.#colour.g, this.#colour.b, 0.9 * (1 - age) ** 1.5);
    }
    this.#positions.needsUpdate = true;
    this.#colours.needsUpdate = true;
    this.line.geometry.setDrawRange(0, count);
  }

  dispose(): void {
    this.line.geometry.dispose();
    this.line.material.dispose();
  }
}
