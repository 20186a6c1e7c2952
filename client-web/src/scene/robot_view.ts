// The robot's 3-D view: it draws when something changed, at most once per display frame.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { RobotPose } from "../theory/robot";
import { Finish } from "./finish";
import { LineGround, type StageColours } from "./ground";
import { contextOf, processorDraws } from "./quality";
import { RobotModel, type RobotColours } from "./robot_model";
import { lookFrom, type Sight, sightOf } from "./sight";
import { Trail } from "./trail";
import { type Ramp, type Workspace, WorkspaceModel } from "./workspace_model";

export interface RobotViewColours extends StageColours, RobotColours {
  readonly trail: string;
  readonly ramp: Ramp;
}

const FIELD_OF_VIEW_DEG = 30;
/** From between two arms of the desktop robot, so that none of them points at the camera. */
const FROM = new THREE.Vector3(0.5, -1, 0.5).normalize();
/** Where the processor draws, it does something else for this many times as long as a frame took. */
const REST = 2;

export class RobotView {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #scene = new THREE.Scene();
  readonly #camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 10, 5000);
  readonly #orbit: OrbitControls;
  readonly #robot = new RobotModel();
  readonly #workspace = new WorkspaceModel();
  readonly #ground = new LineGround();
  readonly #trail = new Trail();
  readonly #sky = new THREE.HemisphereLight(0xffffff, 0x8a8f98, 1.7);
  readonly #key = new THREE.DirectionalLight(0xffffff, 1.9);
  readonly #finish: Finish | undefined;
  #rest_until_ms = Number.NEGATIVE_INFINITY;
  #changed = true;
  #turned = false;
  /** What the canvas is to get with the next picture. */
  #size: { readonly width: number; readonly height: number; readonly pixels: number } | undefined;

  /** `sight` is that of a view before. Throws when the browser has no WebGL 2. */
  constructor(canvas: HTMLCanvasElement, sight?: Sight) {
    const { context } = contextOf(canvas, undefined);
    this.#renderer = new THREE.WebGLRenderer({ canvas, context });
    this.#finish = processorDraws() ? new Finish(context, this.#onFinish) : undefined;
    this.#camera.up.set(0, 0, 1);
    this.#key.position.set(-300, -500, 700);
    this.#ground.object.position.z = -12;
    this.#scene.add(this.#sky, this.#key, this.#ground.object, this.#robot.group, this.#workspace.group, this.#trail.line);
    this.#orbit = new OrbitControls(this.#camera, canvas);
    this.#orbit.enableDamping = true;
    this.#orbit.dampingFactor = 0.12;
    this.#orbit.minDistance = 100;
    this.#orbit.maxDistance = 3000;
    this.#orbit.listenToKeyEvents(canvas);
    this.#orbit.addEventListener("change", this.#onMove);
    this.#orbit.addEventListener("start", this.#onGrab);
    this.reset(0.3);
    if (sight !== undefined) {
      this.#turned = true;
      lookFrom(sight, this.#camera, this.#orbit);
    }
  }

  /** Nothing while nobody has turned the view. */
  get sight(): Sight | undefined {
    return this.#turned ? sightOf(this.#camera, this.#orbit) : undefined;
  }

  /** Looks at a robot of about this reach from its corner. */
  reset(reach_m: number): void {
    const half = THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2);
    const target = new THREE.Vector3(0, 0, 300 * reach_m);
    this.#orbit.target.copy(target);
    this.#camera.position.copy(FROM).multiplyScalar((760 * reach_m) / Math.tan(half) / Math.min(1, this.#camera.aspect)).add(target);
    this.#orbit.update();
    this.#turned = false;
    this.#changed = true;
  }

  setPose(pose: RobotPose): void {
    this.#robot.place(pose);
    this.#workspace.slideTo(pose.position_m[2]);
    this.#changed = true;
  }

  setTrail(points_m: readonly number[]): void {
    this.#trail.set(points_m, 0);
    this.#changed = true;
  }

  setWorkspace(workspace: Workspace | undefined): void {
    this.#workspace.set(workspace);
    this.#changed = true;
  }

  showWorkspace(what: "hull" | "slice" | "nothing"): void {
    this.#workspace.show(what);
    this.#changed = true;
  }

  setColours(colours: RobotViewColours): void {
    this.#scene.background = new THREE.Color(colours.background);
    this.#ground.colour(colours);
    this.#robot.setColours(colours);
    this.#workspace.setColours(colours.ramp);
    this.#trail.setColour(colours.trail);
    this.#rest_until_ms = Number.NEGATIVE_INFINITY; // a page half in the other theme is worse than a frame too many
    this.#changed = true;
  }

  /**
   * A canvas of another size is empty: it gets that size when the picture for it is drawn, and is stretched until then.
   */
  resize(width: number, height: number, devicePixels: number): void {
    this.#camera.aspect = Math.max(width, 1) / Math.max(height, 1);
    this.#camera.updateProjectionMatrix();
    this.#size = { width: Math.max(width, 1), height: Math.max(height, 1), pixels: processorDraws() ? 1 : Math.min(devicePixels, 2) };
    this.#rest_until_ms = Number.NEGATIVE_INFINITY;
    this.#changed = true;
  }

  draw(now_ms: number): void {
    this.#orbit.update();
    if (!this.#changed || this.#finish?.isAhead === true || now_ms < this.#rest_until_ms) return;
    this.#changed = false;
    if (this.#size !== undefined) {
      this.#renderer.setPixelRatio(this.#size.pixels);
      this.#renderer.setSize(this.#size.width, this.#size.height, false);
      this.#size = undefined;
    }
    const began_ms = performance.now();
    this.#renderer.render(this.#scene, this.#camera);
    this.#finish?.awaitFrame(began_ms);
  }

  dispose(): void {
    this.#finish?.dispose();
    this.#orbit.dispose();
    for (const owner of [this.#robot, this.#workspace, this.#ground, this.#trail, this.#sky, this.#key]) owner.dispose();
    this.#renderer.dispose();
  }

  readonly #onMove = (): void => {
    this.#changed = true;
  };

  /** Once somebody has turned the view, it is theirs: it no longer follows the window's size. */
  readonly #onGrab = (): void => {
    this.#turned = true;
  };

  readonly #onFinish = (duration_ms: number): void => {
    this.#rest_until_ms = performance.now() + REST * duration_ms;
  };
}
