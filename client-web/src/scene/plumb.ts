// How high the tool is: a line straight down from it, that ends where the clay begins, and a ring on the ground below.

import * as THREE from "three";

const RING_MM = 4.5;
const STEPS = 32;
/** Above the ground's own lines. */
const LIFT_MM = 0.15;

export class Plumb {
  readonly group = new THREE.Group();
  readonly #material = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.85, toneMapped: false });
  /** What the clay hides is still guessed at. */
  readonly #faint = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.22, depthTest: false, toneMapped: false });
  readonly #down = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(0, 0, 0), new THREE.Vector3(0, 0, 1)]);
  readonly #circle = new THREE.BufferGeometry().setFromPoints(ring());
  readonly #lines: readonly THREE.Line[];
  readonly #rings: readonly THREE.Line[];

  constructor() {
    this.#lines = [new THREE.Line(this.#down, this.#material), new THREE.Line(this.#down, this.#faint)];
    this.#rings = [new THREE.Line(this.#circle, this.#material), new THREE.Line(this.#circle, this.#faint)];
    for (const ring of this.#rings) ring.position.z = LIFT_MM;
    this.group.add(...this.#lines, ...this.#rings);
    this.group.visible = false;
  }

  setColour(colour: string): void {
    this.#material.color.set(colour);
    this.#faint.color.set(colour);
  }

  /** Below a tool at `at`, mm. */
  drop(at: THREE.Vector3): void {
    this.group.visible = true;
    this.group.position.set(at.x, at.y, 0);
    for (const line of this.#lines) line.scale.z = at.z;
  }

  hide(): void {
    this.group.visible = false;
  }

  dispose(): void {
    for (const owner of [this.#down, this.#circle, this.#material, this.#faint]) owner.dispose();
  }
}

function ring(): THREE.Vector3[] {
  return Array.from({ length: STEPS + 1 }, (_, n) => {
    const angle = (2 * Math.PI * n) / STEPS;
    return new THREE.Vector3(RING_MM * Math.cos(angle), RING_MM * Math.sin(angle), 0);
  });
}
