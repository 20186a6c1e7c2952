// The tool in the clay, and the ghost of it where the handle would have it.

import * as THREE from "three";
import type { ToolShape } from "../protocol/session";
import type { Quality } from "./quality";
import { RoomEnvironment } from "three/examples/jsm/environments/RoomEnvironment.js";

/** Size of a tool, in millimetres. */
export type ToolSize =
  | { readonly kind: "ball"; readonly radius: number }
  | { readonly kind: "blade"; readonly width: number; readonly height: number; readonly thickness: number }
  | { readonly kind: "cylinder"; readonly radius: number; readonly height: number }
  | { readonly kind: "loop"; readonly ring: number; readonly wire: number };

/** Closer than this the ghost would only make the tool's outline thick, mm. */
const GHOST_FROM_MM = 0.4;
export const SHAFT_MM = 46;
const MM_PER_M = 1000;

export class ToolModel {
  readonly group = new THREE.Group();
  readonly #tool = new THREE.Group();
  readonly #ghost = new THREE.Group();
  readonly #tether: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  readonly #metal: THREE.Material;
  readonly #dark: THREE.Material;
  readonly #ghostFill = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.16, depthWrite: false, toneMapped: false });
  readonly #ghostLine = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.9, toneMapped: false });
  readonly #environment: THREE.WebGLRenderTarget | undefined;
  #geometries: THREE.BufferGeometry[] = [];

  constructor(renderer: THREE.WebGLRenderer, quality: Quality) {
    if (quality === "fine") {
      this.#environment = roomAround(renderer);
      const envMap = this.#environment.texture;
      this.#metal = new THREE.MeshStandardMaterial({ color: 0xc9d0d8, metalness: 0.95, roughness: 0.28, envMap });
      this.#dark = new THREE.MeshStandardMaterial({ color: 0x2c3440, metalness: 0.4, roughness: 0.5, envMap });
    } else {
      this.#metal = new THREE.MeshPhongMaterial({ color: 0x9aa3ad, specular: 0x888888, shininess: 60 });
      this.#dark = new THREE.MeshLambertMaterial({ color: 0x39424e });
    }
    this.#tether = new THREE.Line(new THREE.BufferGeometry(), this.#ghostLine);
    this.#tether.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
    this.#tether.frustumCulled = false;
    this.group.add(this.#tool, this.#ghost, this.#tether);
    this.group.visible = false;
  }

  setSize(size: ToolSize): void {
    this.#disposeGeometries();
    this.#tool.clear();
    this.#ghost.clear();
    const { body, shaft } = partsOf(size);
    const outline = outlineOf(size, body);
    this.#geometries = [body, shaft, outline];
    for (const [geometry, material] of [[body, this.#metal], [shaft, this.#dark]] as const) {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.castShadow = true;
      this.#tool.add(mesh);
    }
    this.#ghost.add(new THREE.Mesh(body, this.#ghostFill), new THREE.LineSegments(outline, this.#ghostLine));
  }

  setColour(handle: string): void {
    this.#ghostFill.color.set(handle);
    this.#ghostLine.color.set(handle);
  }

  /** Puts tool and ghost in their places, mm. */
  place(tool: THREE.Vector3, handle: THREE.Vector3): void {
    this.group.visible = true;
    this.#tool.position.copy(tool);
    this.#ghost.position.copy(handle);
    const apart = GHOST_FROM_MM < tool.distanceTo(handle);
    this.#ghost.visible = this.#tether.visible = apart;
    if (!apart) return;
    const ends = this.#tether.geometry.getAttribute("position");
    ends.setXYZ(0, tool.x, tool.y, tool.z);
    ends.setXYZ(1, handle.x, handle.y, handle.z);
    ends.needsUpdate = true;
  }

  hide(): void {
    this.group.visible = false;
  }

  dispose(): void {
    this.#disposeGeometries();
    this.#tether.geometry.dispose();
    for (const material of [this.#metal, this.#dark, this.#ghostFill, this.#ghostLine]) material.dispose();
    this.#environment?.dispose();
  }

  #disposeGeometries(): void {
    for (const geometry of this.#geometries) geometry.dispose();
    this.#geometries = [];
  }
}

/** A tool's size as the scene has it. */
export function sizeOf(shape: ToolShape): ToolSize {
  const mm = (metres: number): number => metres * MM_PER_M;
  switch (shape.kind) {
    case "ball": return { kind: "ball", radius: mm(shape.radius_m) };
    case "blade": return { kind: "blade", width: mm(shape.width_m), height: mm(shape.height_m), thickness: mm(shape.thickness_m) };
    case "cylinder": return { kind: "cylinder", radius: mm(shape.radius_m), height: mm(shape.height_m) };
    case "loop": return { kind: "loop", ring: mm(shape.ring_radius_m), wire: mm(shape.wire_diameter_m) };
  }
}

/** What cuts, and what it is held by. */
export function partsOf(size: ToolSize): { readonly body: THREE.BufferGeometry; readonly shaft: THREE.BufferGeometry } {
  const radius = shaftRadius(size);
  const shaft = new THREE.CylinderGeometry(radius, radius, SHAFT_MM, 24)
    .rotateX(Math.PI / 2).translate(0, 0, shaftFrom(size) + SHAFT_MM / 2);
  return { body: bodyOf(size), shaft };
}

/** How high the tool is above its position, mm: where whoever holds it takes hold. */
export function topOf(size: ToolSize): number {
  switch (size.kind) {
    case "ball": return size.radius;
    case "loop": return size.ring + size.wire / 2;
    case "blade":
    case "cylinder": return size.height;
  }
}

/** How high the middle of what cuts is above the tool's position, mm. */
export function middleOf(size: ToolSize): number {
  return size.kind === "ball" || size.kind === "loop" ? 0 : size.height / 2;
}

function bodyOf(size: ToolSize): THREE.BufferGeometry {
  switch (size.kind) {
    case "ball": return new THREE.SphereGeometry(size.radius, 48, 32);
    case "blade": return new THREE.BoxGeometry(size.thickness, size.width, size.height).translate(0, 0, size.height / 2);
    case "cylinder":
      return new THREE.CylinderGeometry(size.radius, size.radius, size.height, 48).rotateX(Math.PI / 2).translate(0, 0, size.height / 2);
    // A torus lies in the plane of x and y; this one stands across x.
    case "loop": return new THREE.TorusGeometry(size.ring, size.wire / 2, 16, 64).rotateY(Math.PI / 2);
  }
}

/** Where the shaft begins, mm above the tool's position: in a ball a little inside, in a loop within the wire. */
function shaftFrom(size: ToolSize): number {
  switch (size.kind) {
    case "ball": return size.radius * 0.8;
    case "loop": return size.ring;
    case "blade":
    case "cylinder": return size.height;
  }
}

function shaftRadius(size: ToolSize): number {
  switch (size.kind) {
    case "ball": return Math.max(size.radius * 0.28, 0.8);
    case "blade": return Math.max(size.thickness * 0.9, 1.2);
    case "cylinder": return Math.max(size.radius * 0.7, 0.8);
    case "loop": return Math.max(size.wire * 0.9, 1.2);
  }
}

function outlineOf(size: ToolSize, body: THREE.BufferGeometry): THREE.BufferGeometry {
  if (size.kind === "ball") return circles(size.radius, [0, 1, 2]);
  if (size.kind === "loop") return circles(size.ring + size.wire / 2, [0]);
  return new THREE.EdgesGeometry(body);
}

/** A bright room for metal to mirror. */
function roomAround(renderer: THREE.WebGLRenderer): THREE.WebGLRenderTarget {
  const generator = new THREE.PMREMGenerator(renderer);
  const room = new RoomEnvironment();
  const environment = generator.fromScene(room, 0.04);
  room.dispose();
  generator.dispose();
  return environment;
}

/** Circles about some of the axes: about all three, the outline of a ball from any side. */
function circles(radius: number, axes: readonly number[]): THREE.BufferGeometry {
  const points: THREE.Vector3[] = [];
  const steps = 64;
  for (const axis of axes) {
    for (let n = 0; n < 2 * steps; n += 1) {
      const angle = (2 * Math.PI * Math.ceil(n / 2)) / steps;
      const at = [0, 0, 0];
      at[(axis + 1) % 3] = radius * Math.cos(angle);
      at[(axis + 2) % 3] = radius * Math.sin(angle);
      points.push(new THREE.Vector3(...at));
    }
  }
  return new THREE.BufferGeometry().setFromPoints(points);
}
