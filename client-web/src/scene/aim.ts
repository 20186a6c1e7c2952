// Where on the screen is where in the clay, for a hand on the picture; and a view that is turned by something else than
// its own controls.

import * as THREE from "three";
import type { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Ray } from "../hand/drag";

const M_PER_MM = 1e-3;

export class Aim {
  readonly #camera: THREE.PerspectiveCamera;
  readonly #orbit: OrbitControls;
  readonly #onTurn: () => void;
  #width = 1;
  #height = 1;

  constructor(camera: THREE.PerspectiveCamera, orbit: OrbitControls, onTurn: () => void) {
    this.#camera = camera;
    this.#orbit = orbit;
    this.#onTurn = onTurn;
  }

  /** Size of the picture in CSS pixels. */
  resize(width: number, height: number): void {
    this.#width = width;
    this.#height = height;
  }

  /** From the eye through a point of the picture, in the clay's frame. */
  rayAt(x: number, y: number): Ray {
    this.#camera.updateMatrixWorld();
    const at = new THREE.Vector3((2 * x) / this.#width - 1, 1 - (2 * y) / this.#height, 0.5).unproject(this.#camera);
    const from = this.#camera.position;
    const along = at.sub(from).normalize();
    return { from_m: from.clone().multiplyScalar(M_PER_MM).toArray(), along: along.toArray() };
  }

  /** The way that is away from the eye, on the ground. */
  away(): readonly [number, number] {
    const away = this.#orbit.target.clone().sub(this.#camera.position);
    return [away.x, away.y];
  }

  /** Turns the view about its middle: all the way round for the picture's height, as its own controls do. */
  turn(x: number, y: number): void {
    const offset = this.#camera.position.clone().sub(this.#orbit.target);
    const toUp = new THREE.Quaternion().setFromUnitVectors(this.#camera.up, new THREE.Vector3(0, 1, 0));
    const sphere = new THREE.Spherical().setFromVector3(offset.applyQuaternion(toUp));
    const turn = (2 * Math.PI) / this.#height;
    sphere.theta -= x * turn;
    sphere.phi -= y * turn;
    sphere.makeSafe();
    this.#camera.position.setFromSpherical(sphere).applyQuaternion(toUp.invert()).add(this.#orbit.target);
    this.#camera.lookAt(this.#orbit.target);
    this.#onTurn();
  }
}
