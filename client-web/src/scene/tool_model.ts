// The tool in the clay, and the ghost of it where the handle would have it.

import * as THREE from "three";
import type { Quality } from "./quality";
import { RoomEnvironment } from "three/examples/jsm/environments/RoomEnvironment.js";

/** Size of a tool, in millimetres. */
export type ToolSize =
  | { readonly kind: "ball"; readonly radius: number }
  | { readonly kind: "blade"; readonly width: number; readonly height: number; readonly thickness: number };

/** Closer than this the ghost would only make the tool's outline thick, mm. */
const GHOST_FROM_MM = 0.4;
export const SHAFT_MM = 46;

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
    const outline = size.kind === "ball" ? rings(size.radius) : new THREE.EdgesGeometry(body);
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

/** What cuts, and what it is held by. */
export function partsOf(size: ToolSize): { readonly body: THREE.BufferGeometry; readonly shaft: THREE.BufferGeometry } {
  const body = size.kind === "ball"
    ? new THREE.SphereGeometry(size.radius, 48, 32)
    : new THREE.BoxGeometry(size.thickness, size.width, size.height).translate(0, 0, size.height / 2);
  const top = size.kind === "ball" ? size.radius * 0.8 : size.height;
  const thickness = size.kind === "ball" ? Math.max(size.radius * 0.28, 0.8) : Math.max(size.thickness * 0.9, 1.2);
  const shaft = new THREE.CylinderGeometry(thickness, thickness, SHAFT_MM, 24)
    .rotateX(Math.PI / 2).translate(0, 0, top + SHAFT_MM / 2);
  return { body, shaft };
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

/** Three great circles: the outline of a ball from any side. */
function rings(radius: number): THREE.BufferGeometry {
  const points: THREE.Vector3[] = [];
  const steps = 64;
  for (let axis = 0; axis < 3; axis += 1) {
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
