// The parallel robot as a thing: base, three arms of an upper link and two rods, platform. Scene units are millimetres,
// z up.

import * as THREE from "three";
import type { Arm } from "../protocol/mathematics";
import type { Triple } from "../protocol/theory";
import type { RobotPose } from "../theory/robot";

/** Radii of the robot's links and rods, in millimetres. */
const LINK_RADIUS = 4;
const ROD_RADIUS = 1.7;
const JOINT_RADIUS = 3.4;
/** Between the two rods of an arm, which keep the platform level. */
const ROD_GAP = 22;
const PLATE_MM = 5;
const UP = new THREE.Vector3(0, 1, 0);

export interface RobotColours {
  /** One per arm. */
  readonly arms: readonly [string, string, string];
  readonly short: string;
}

interface ArmParts {
  readonly group: THREE.Group;
  readonly motor: THREE.Mesh;
  readonly link: THREE.Mesh;
  readonly elbow: THREE.Mesh;
  readonly wrist: THREE.Mesh;
  readonly rods: readonly [THREE.Mesh, THREE.Mesh];
  readonly balls: readonly THREE.Mesh[];
  readonly material: THREE.MeshLambertMaterial;
}

export class RobotModel {
  readonly group = new THREE.Group();
  readonly #bar = new THREE.CylinderGeometry(1, 1, 1, 20).translate(0, 0.5, 0);
  readonly #ball = new THREE.SphereGeometry(1, 20, 14);
  readonly #disc = new THREE.CylinderGeometry(1, 1, 1, 48).rotateX(Math.PI / 2);
  readonly #dark = new THREE.MeshLambertMaterial({ color: 0x68737f });
  readonly #light = new THREE.MeshLambertMaterial({ color: 0xc3cad2 });
  readonly #base = new THREE.Mesh(this.#disc, this.#dark);
  readonly #platform = new THREE.Mesh(this.#disc, this.#light);
  readonly #arms: readonly ArmParts[];
  #colours: RobotColours = { arms: ["#888888", "#888888", "#888888"], short: "#cc0000" };

  constructor() {
    this.#arms = [0, 1, 2].map(() => this.#makeArm());
    this.group.add(this.#base, this.#platform, ...this.#arms.map(({ group }) => group));
    this.group.traverse((part) => {
      part.castShadow = true;
    });
  }

  setColours(colours: RobotColours): void {
    this.#colours = colours;
    this.#arms.forEach(({ material }, j) => material.color.set(colours.arms[j]));
  }

  /** Of an arm that does not reach only the motor is there, and the arm's colour is that of trouble. */
  place({ geometry, position_m, arms }: RobotPose): void {
    const base = mm(geometry.base_radius_m);
    this.#base.scale.set(base, base, PLATE_MM);
    this.#base.position.z = -PLATE_MM - JOINT_RADIUS;
    const platform = Math.max(mm(geometry.platform_radius_m), 2);
    this.#platform.scale.set(platform, platform, PLATE_MM);
    this.#platform.position.set(mm(position_m[0]), mm(position_m[1]), mm(position_m[2]) + PLATE_MM / 2 + 1);
    this.#arms.forEach((parts, j) => {
      const arm = arms[j];
      const isShort = arm.bend === undefined;
      parts.material.color.set(isShort ? this.#colours.short : this.#colours.arms[j]);
      for (const part of [parts.link, parts.elbow, parts.wrist, ...parts.rods, ...parts.balls]) part.visible = !isShort;
      const [ex, ey] = arm.direction;
      const across = new THREE.Vector3(-ey, ex, 0);
      parts.motor.position.set(base * ex, base * ey, 0).addScaledVector(across, -13);
      parts.motor.quaternion.setFromUnitVectors(UP, across);
      parts.motor.scale.set(8, 26, 8);
      if (arm.bend !== undefined) placeArm(parts, arm, arm.bend.elbow_m, across);
    });
  }

  dispose(): void {
    for (const geometry of [this.#bar, this.#ball, this.#disc]) geometry.dispose();
    for (const material of [this.#dark, this.#light, ...this.#arms.map((arm) => arm.material)]) material.dispose();
  }

  #makeArm(): ArmParts {
    const material = new THREE.MeshLambertMaterial();
    const bar = (of: THREE.Material): THREE.Mesh => new THREE.Mesh(this.#bar, of);
    const parts: ArmParts = {
      group: new THREE.Group(),
      motor: bar(this.#dark),
      link: bar(material),
      elbow: bar(this.#dark),
      wrist: bar(this.#dark),
      rods: [bar(this.#light), bar(this.#light)],
      balls: Array.from({ length: 4 }, () => new THREE.Mesh(this.#ball, this.#dark)),
      material,
    };
    parts.group.add(parts.motor, parts.link, parts.elbow, parts.wrist, ...parts.rods, ...parts.balls);
    for (const ball of parts.balls) ball.scale.setScalar(JOINT_RADIUS);
    return parts;
  }
}

function placeArm(parts: ArmParts, { shoulder_m, wrist_m }: Arm, elbow_m: Triple, across: THREE.Vector3): void {
  const [shoulder, elbow, wrist] = [shoulder_m, elbow_m, wrist_m].map((at) => new THREE.Vector3(...at).multiplyScalar(1000));
  between(parts.link, shoulder, elbow, LINK_RADIUS);
  const ends = [-ROD_GAP / 2, ROD_GAP / 2].map((side) => [
    elbow.clone().addScaledVector(across, side), wrist.clone().addScaledVector(across, side),
  ]);
  parts.rods.forEach((rod, n) => between(rod, ends[n][0], ends[n][1], ROD_RADIUS));
  parts.balls.forEach((ball, n) => ball.position.copy(ends[n >> 1][n & 1]));
  between(parts.elbow, ends[0][0], ends[1][0], 2.4);
  between(parts.wrist, ends[0][1], ends[1][1], 2.4);
}

/** A bar of radius `radius` from one point to another. */
function between(bar: THREE.Mesh, from: THREE.Vector3, to: THREE.Vector3, radius: number): void {
  const way = to.clone().sub(from);
  const length = way.length();
  bar.position.copy(from);
  bar.scale.set(radius, Math.max(length, 0.01), radius);
  if (0 < length) bar.quaternion.setFromUnitVectors(UP, way.divideScalar(length));
}

const mm = (metres: number): number => 1000 * metres;
