// The 3-D view: camera, renderer and the things in it. It draws when something changed, at most once per display frame.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { PastMesh } from "../clay/past_mesh";
import type { Meshes } from "../clay/port";
import type { ToolShape, Vector } from "../protocol/session";
import { Aim } from "./aim";
import { Arrow } from "./arrow";
import { type BlockDescription, ClayMesh } from "./clay_mesh";
import { Finish } from "./finish";
import type { StageColours } from "./ground";
import { OtherTools } from "./other_tools";
import { COARSEST, DISPLAY, Pace, PROCESSOR } from "./pace";
import { PastClay } from "./past_clay";
import { Plumb } from "./plumb";
import { contextOf, processorDraws, type Quality } from "./quality";
import { rest } from "./rest";
import { lookFrom, type Sight, sightOf } from "./sight";
import { Stage } from "./stage";
import { middleOf, SHAFT_MM, sizeOf, ToolModel, topOf } from "./tool_model";
import { Trail } from "./trail";

export interface ViewColours extends StageColours {
  readonly hand: string;
  readonly felt: string;
  readonly tool: string;
}

/** One moment, in the clay's frame. */
export interface Pose {
  readonly tool_m: Vector;
  /** Where the handle would have the tool. */
  readonly handle_m: Vector;
  readonly toolForce_n: Vector;
  readonly feltForce_n: Vector;
  /** Whoever moves the tool from this page sees how high it is. */
  readonly isHeldHere: boolean;
}

/** Where to look from: a direction, from the block's centre. */
export const LOOKS = {
  corner: [-0.62, -1, 0.72],
  front: [0, -1, 0.12],
  side: [1, -0.02, 0.12],
  top: [0, -0.02, 1],
} as const;
export type Look = keyof typeof LOOKS;

const MM_PER_M = 1000;
const FIELD_OF_VIEW_DEG = 28;
/** The tool's path runs in the surface it leaves behind: a little above, it can be seen. */
const TRAIL_LIFT_MM = 0.7;
/** Shadows cost about as much as the picture: on a slow machine they follow a little behind. */
const SHADOWS_EVERY_MS: Record<Quality, number> = { fine: 0, plain: 1500 };
export class ClayView {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #scene = new THREE.Scene();
  readonly #camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 5, 5000);
  readonly #orbit: OrbitControls;
  readonly #quality: Quality;
  readonly #stage: Stage;
  readonly #clay: ClayMesh;
  readonly #past: PastClay;
  /** What is as it is now: out of sight while the past is shown. */
  readonly #present = new THREE.Group();
  readonly #tool: ToolModel;
  readonly #others = new OtherTools();
  readonly #toolForce = new Arrow();
  readonly #feltForce = new Arrow();
  readonly #trail = new Trail();
  readonly #plumb = new Plumb();
  /** For a hand on the picture. */
  readonly aim: Aim;
  readonly #pace: Pace;
  /** Where the processor draws: what tells that the last frame is finished. */
  readonly #finish: Finish | undefined;
  readonly #at = { tool: new THREE.Vector3(), handle: new THREE.Vector3(), force: new THREE.Vector3() };
  #size = new THREE.Vector3(128, 64, 64);
  /** Heights above the tool's position of where the clay pushes and where the hand holds. */
  #cutting_mm = 0;
  #grip_mm = 0;
  #width = 1;
  #height = 1;
  #devicePixels = 1;
  #changed = true;
  #sizeDue = true;
  #shadowsDue = true;
  #shadows_ms = Number.NEGATIVE_INFINITY;
  #look: Look | undefined = "corner";
  /** From where somebody looked before this view was made; until the block is there. */
  #sight: Sight | undefined;
  #posed: readonly number[] = [Number.NaN];
  #trailed: readonly number[] = [];
  #placed: readonly number[] = [];

  /**
   * `wanted` fixes the quality, whatever the machine makes of it; `sight` is that of a view before. Throws when the
   * browser has no WebGL 2.
   */
  constructor(canvas: HTMLCanvasElement, wanted: Quality | undefined, sight?: Sight) {
    const { context, quality } = contextOf(canvas, wanted);
    this.#quality = quality;
    this.#renderer = new THREE.WebGLRenderer({ canvas, context });
    this.#renderer.shadowMap.enabled = true;
    this.#renderer.shadowMap.autoUpdate = false;
    this.#renderer.shadowMap.type = quality === "fine" ? THREE.PCFShadowMap : THREE.BasicShadowMap;
    const finest = quality === "fine" ? 1 : 0.7;
    this.#pace = new Pace(finest, wanted === undefined ? COARSEST : finest, processorDraws() ? PROCESSOR : DISPLAY);
    this.#finish = processorDraws() ? new Finish(context, this.#onFinish) : undefined;
    this.#stage = new Stage(quality);
    this.#clay = new ClayMesh(quality);
    this.#past = new PastClay(quality);
    this.#renderer.toneMapping = THREE.AgXToneMapping;
    this.#renderer.toneMappingExposure = 1.25;
    this.#tool = new ToolModel(this.#renderer, quality);
    this.#camera.up.set(0, 0, 1);
    this.#orbit = new OrbitControls(this.#camera, canvas);
    this.#orbit.enableDamping = true;
    this.#orbit.dampingFactor = 0.12;
    this.#orbit.minDistance = 20;
    this.#orbit.maxDistance = 1500;
    this.#orbit.listenToKeyEvents(canvas);
    this.#orbit.addEventListener("change", this.#onMove);
    this.#orbit.addEventListener("start", this.#onGrab);
    this.#present.add(this.#clay.mesh, this.#tool.group, this.#others.group, this.#trail.line);
    this.#present.add(this.#toolForce.group, this.#feltForce.group, this.#plumb.group);
    this.aim = new Aim(this.#camera, this.#orbit, () => {
      this.#onGrab();
      this.#onMove();
    });
    this.#scene.add(this.#stage.group, this.#present, this.#past.mesh);
    this.look("corner");
    this.#sight = sight;
    this.#lookAgain();
  }

  /** Nothing while nobody has turned the view. */
  get sight(): Sight | undefined {
    return this.#look === undefined ? sightOf(this.#camera, this.#orbit) : undefined;
  }

  /** Of the clay on show. */
  get triangles(): number {
    return this.#past.isShown ? this.#past.triangles : this.#clay.triangles;
  }

  /** Share of the screen's resolution that is drawn: below 1 where the graphics card is slow. */
  get resolution(): number {
    return this.#pace.scale;
  }

  applyClay(update: Meshes): void {
    this.#clay.apply(update);
    this.#touchPresent();
  }

  /** Shows the clay of another moment, and nothing of what is now; nothing: now. */
  setPast(past: PastMesh | undefined): void {
    if (past === undefined) this.#past.hide();
    else this.#past.show(past);
    this.#present.visible = past === undefined;
    rest.breakOff(); // somebody waits for it
    this.#touch();
  }

  setBlock(block: BlockDescription): void {
    this.#clay.setBlock(block);
    this.#past.setBlock(block);
    const size = new THREE.Vector3(...block.size_m).multiplyScalar(MM_PER_M);
    if (!size.equals(this.#size)) {
      this.#size = size;
      this.#stage.fit(size);
      this.look(this.#look ?? "corner");
      this.#lookAgain();
    }
    this.#touch();
  }

  setTool(shape: ToolShape): void {
    const size = sizeOf(shape);
    this.#tool.setSize(size);
    this.#others.setSize(size);
    this.#placed = [Number.NaN];
    this.#cutting_mm = middleOf(size);
    this.#grip_mm = topOf(size) + 0.7 * SHAFT_MM;
    this.#touch();
  }

  /** Tool, ghost and arrows; nothing when nobody holds the tool. A pose that is the last one costs nothing. */
  setPose(pose: Pose | undefined, mm_per_n: number): void {
    const now = pose === undefined ? [] : [...pose.tool_m, ...pose.handle_m, ...pose.toolForce_n, ...pose.feltForce_n, mm_per_n, Number(pose.isHeldHere)];
    if (isSame(now, this.#posed)) return;
    this.#posed = now;
    this.#touchPresent();
    if (pose === undefined) {
      for (const part of [this.#tool, this.#toolForce, this.#feltForce, this.#plumb]) part.hide();
      return;
    }
    const { tool, handle, force } = this.#at;
    tool.set(...pose.tool_m).multiplyScalar(MM_PER_M);
    handle.set(...pose.handle_m).multiplyScalar(MM_PER_M);
    this.#tool.place(tool, handle);
    if (pose.isHeldHere) this.#plumb.drop(tool);
    else this.#plumb.hide();
    force.set(...pose.toolForce_n);
    tool.z += this.#cutting_mm;
    handle.z += this.#grip_mm;
    this.#toolForce.point(tool, force, force.length() * mm_per_n);
    force.set(...pose.feltForce_n);
    this.#feltForce.point(handle, force, force.length() * mm_per_n);
  }

  /** Where the tools of others are, m. Places that are the last ones cost nothing. */
  setOthers(places_m: readonly Vector[]): void {
    const now = places_m.flat();
    if (isSame(now, this.#placed)) return;
    this.#placed = now;
    this.#others.place(places_m);
    this.#touchPresent();
  }

  /** How many tools of others are on show. */
  get others(): number {
    return this.#others.count;
  }

  /** Where the tool has been: x, y, z in m one after the other, oldest first. */
  setTrail(points_m: readonly number[]): void {
    if (isSame(points_m, this.#trailed)) return;
    this.#trailed = points_m;
    this.#trail.set(points_m, TRAIL_LIFT_MM);
    this.#changed ||= !this.#past.isShown;
  }

  setColours(colours: ViewColours, dark: boolean): void {
    rest.breakOff(); // a page half in the other theme is worse than a frame too many
    this.#scene.background = new THREE.Color(colours.background);
    this.#stage.colour(colours, dark);
    this.#tool.setColour(colours.hand);
    this.#toolForce.setColour(colours.tool);
    this.#feltForce.setColour(colours.felt);
    this.#trail.setColour(colours.tool);
    this.#plumb.setColour(colours.hand);
    this.#trailed = [];
    this.#changed = true;
  }

  /** Looks at the whole block from one side. */
  look(from: Look): void {
    this.#look = from;
    const centre = this.#size.clone().multiplyScalar(0.5);
    const half = THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2);
    // A narrow picture needs more room: the block is wider than it is tall.
    const distance = (this.#size.length() * 0.55) / Math.tan(half) / Math.min(1, this.#camera.aspect * 0.82);
    this.#orbit.target.copy(centre);
    this.#camera.position.copy(new THREE.Vector3(...LOOKS[from]).normalize().multiplyScalar(distance).add(centre));
    this.#orbit.update();
    this.#changed = true;
  }

  /** Size of the canvas in CSS pixels. */
  resize(width: number, height: number, devicePixels: number): void {
    this.#width = Math.max(width, 1);
    this.#height = Math.max(height, 1);
    this.#devicePixels = devicePixels;
    this.aim.resize(this.#width, this.#height);
    this.#camera.aspect = this.#width / this.#height;
    this.#camera.updateProjectionMatrix();
    rest.breakOff();
    this.#fitCanvas();
    if (this.#look !== undefined) this.look(this.#look);
  }

  /** Draws if anything changed since the last time and that is finished; returns whether it did. */
  draw(now_ms: number): boolean {
    this.#orbit.update();
    const shadows = this.#shadowsDue && SHADOWS_EVERY_MS[this.#quality] <= now_ms - this.#shadows_ms;
    if (!(this.#changed || shadows) || !rest.isOver(now_ms)) return false;
    this.#changed = false;
    if (shadows) {
      this.#renderer.shadowMap.needsUpdate = true;
      this.#shadowsDue = false;
      this.#shadows_ms = now_ms;
    }
    this.#clay.lookFrom(shadows ? undefined : this.#camera.position);
    if (this.#sizeDue) this.#takeSize();
    const began_ms = performance.now();
    this.#renderer.render(this.#scene, this.#camera);
    if (this.#finish !== undefined) {
      rest.begin();
      this.#finish.awaitFrame(began_ms);
    } else if (this.#pace.add(now_ms)) this.#fitCanvas();
    return true;
  }

  dispose(): void {
    this.#finish?.dispose();
    if (this.#finish !== undefined) rest.end(performance.now());
    this.#orbit.dispose();
    for (const owner of [this.#stage, this.#clay, this.#past, this.#tool, this.#others, this.#toolForce, this.#feltForce, this.#trail, this.#plumb]) owner.dispose();
    this.#renderer.dispose();
  }

  readonly #onMove = (): void => {
    this.#changed = true;
  };

  readonly #onFinish = (duration_ms: number): void => {
    rest.end(performance.now(), duration_ms);
    if (this.#pace.take(duration_ms)) this.#fitCanvas();
  };

  /** Once somebody has turned the view, it is theirs: it no longer follows the window's size. */
  readonly #onGrab = (): void => {
    this.#look = undefined;
    this.#sight = undefined;
  };

  #lookAgain(): void {
    if (this.#sight === undefined) return;
    this.#look = undefined;
    lookFrom(this.#sight, this.#camera, this.#orbit);
  }

  /** Something that is as it is now has moved: nobody sees that while the past is shown. */
  #touchPresent(): void {
    if (!this.#past.isShown) this.#touch();
  }

  /** Something that casts a shadow has moved. */
  #touch(): void {
    this.#changed = true;
    this.#shadowsDue = true;
  }

  /**
   * A canvas of another size is empty: it gets that size when the picture for it is drawn, and is stretched until then.
   */
  #fitCanvas(): void {
    this.#sizeDue = true;
    this.#changed = true;
  }

  #takeSize(): void {
    const finest = this.#quality === "fine" ? 2 : 1;
    this.#renderer.setPixelRatio(Math.min(this.#devicePixels, finest) * this.#pace.scale);
    this.#renderer.setSize(this.#width, this.#height, false);
    this.#sizeDue = false;
  }
}

function isSame(a: readonly number[], b: readonly number[]): boolean {
  return a.length === b.length && a.every((value, n) => value === b[n]);
}
