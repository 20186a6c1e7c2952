// A force as an arrow: its direction, and its length by a scale that the page shows beside the picture.

import * as THREE from "three";

const SHAFT_RADIUS_MM = 0.75;
const HEAD_RADIUS_MM = 2.2;
const HEAD_MM = 6;
/** Shorter arrows are not drawn: they would be a head without a direction. */
const SHORTEST_MM = 0.5;
const UP = new THREE.Vector3(0, 1, 0);

export class Arrow {
  readonly group = new THREE.Group();
  readonly #material = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.95, depthTest: false, toneMapped: false });
  readonly #shaft: THREE.Mesh;
  readonly #head: THREE.Mesh;

  constructor() {
    const shaft = new THREE.CylinderGeometry(SHAFT_RADIUS_MM, SHAFT_RADIUS_MM, 1, 16).translate(0, 0.5, 0);
    const head = new THREE.ConeGeometry(HEAD_RADIUS_MM, HEAD_MM, 24).translate(0, -HEAD_MM / 2, 0);
    this.#shaft = new THREE.Mesh(shaft, this.#material);
    this.#head = new THREE.Mesh(head, this.#material);
    this.group.add(this.#shaft, this.#head);
    // A force is not a thing in the room: nothing hides it.
    for (const part of [this.#shaft, this.#head]) part.renderOrder = 10;
    this.group.visible = false;
  }

  setColour(colour: string): void {
    this.#material.color.set(colour);
  }

  /** From `at`, mm, along `force`; `length` is the arrow's, mm. */
  point(at: THREE.Vector3, force: THREE.Vector3, length: number): void {
    this.group.visible = SHORTEST_MM < length;
    if (!this.group.visible) return;
    this.group.position.copy(at);
    this.group.quaternion.setFromUnitVectors(UP, force.clone().normalize());
    // A short arrow has a small head rather than one that is longer than the arrow.
    const head = Math.min(1, length / (1.6 * HEAD_MM));
    this.#head.scale.setScalar(head);
    this.#head.position.y = length;
    this.#shaft.scale.set(head, Math.max(length - head * HEAD_MM, 0.01), head);
  }

  hide(): void {
    this.group.visible = false;
  }

  dispose(): void {
    this.#shaft.geometry.dispose();
    this.#head.geometry.dispose();
    this.#material.dispose();
  }
}
