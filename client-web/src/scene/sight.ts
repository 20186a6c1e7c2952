// From where somebody looks who has turned a view: kept when the view is made anew.

import type { PerspectiveCamera } from "three";
import type { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

/** Places in the scene, mm. */
export interface Sight {
  readonly from: readonly [number, number, number];
  readonly at: readonly [number, number, number];
}

export function sightOf(camera: PerspectiveCamera, orbit: OrbitControls): Sight {
  return { from: camera.position.toArray(), at: orbit.target.toArray() };
}

export function lookFrom({ from, at }: Sight, camera: PerspectiveCamera, orbit: OrbitControls): void {
  orbit.target.set(...at);
  camera.position.set(...from);
  orbit.update();
}
