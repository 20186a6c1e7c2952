// Light, ground and scale: what stands still around the clay. Scene units are millimetres, z up.

import * as THREE from "three";
import { type Ground, LineGround, SmoothGround, type StageColours } from "./ground";
import type { Quality } from "./quality";

/** Just below the clay's underside, so that the two do not fight for the same pixels. */
const GROUND_Z_MM = -0.08;
const LABEL_EVERY_MM = 50;
const LABEL_HEIGHT_MM = 6;

export class Stage {
  readonly group = new THREE.Group();
  readonly #key = new THREE.DirectionalLight(0xfff1e2, 2.8);
  readonly #sky = new THREE.HemisphereLight(0xe9f1ff, 0x9a8270, 1.2);
  readonly #rim = new THREE.DirectionalLight(0xcfe0ff, 0.55);
  readonly #ground: Ground;
  readonly #shade: THREE.Mesh<THREE.PlaneGeometry, THREE.ShadowMaterial>;
  #labels: FlatText[] = [];
  #size = new THREE.Vector3(128, 64, 64);
  #colours: StageColours | undefined;

  constructor(quality: Quality) {
    this.#key.castShadow = true;
    this.#key.shadow.mapSize.setScalar(quality === "fine" ? 2048 : 768);
    this.#key.shadow.bias = -0.0006;
    this.#key.shadow.normalBias = 0.7;
    this.#key.shadow.radius = 5;
    this.#ground = quality === "fine" ? new SmoothGround() : new LineGround();
    this.#shade = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), new THREE.ShadowMaterial({ opacity: 0.28 }));
    this.#shade.position.z = GROUND_Z_MM / 2;
    this.#shade.receiveShadow = true;
    this.group.add(this.#sky, this.#key, this.#key.target, this.#rim, this.#rim.target, this.#ground.object, this.#shade);
    this.fit(this.#size);
  }

  /** Puts light and labels around a block of this size, mm. */
  fit(size: THREE.Vector3): void {
    this.#size = size.clone();
    const centre = size.clone().multiplyScalar(0.5);
    const reach = size.length() * 0.62;
    this.#key.position.copy(centre).add(new THREE.Vector3(-0.95, -0.42, 1.25).multiplyScalar(reach * 2));
    this.#key.target.position.copy(centre);
    this.#rim.position.copy(centre).add(new THREE.Vector3(1, 0.9, 0.35).multiplyScalar(reach * 2));
    this.#rim.target.position.copy(centre);
    const camera = this.#key.shadow.camera;
    camera.left = camera.bottom = -reach * 1.25;
    camera.right = camera.top = reach * 1.25;
    camera.near = reach;
    camera.far = reach * 6;
    camera.updateProjectionMatrix();
    const wholeGrid = (mm: number): number => Math.round(mm / LABEL_EVERY_MM) * LABEL_EVERY_MM;
    this.#ground.object.position.set(wholeGrid(centre.x), wholeGrid(centre.y), GROUND_Z_MM);
    // Only where shadows can fall: the rest of the ground costs nothing then.
    this.#shade.position.setX(centre.x).setY(centre.y);
    this.#shade.scale.setScalar(reach * 3.2);
    this.#label();
  }

  colour(colours: StageColours, dark: boolean): void {
    this.#colours = colours;
    this.#ground.colour(colours);
    this.#shade.material.opacity = dark ? 0.42 : 0.22;
    this.#key.intensity = dark ? 2.5 : 2.8;
    this.#sky.intensity = dark ? 0.9 : 1.2;
    this.#label();
  }

  dispose(): void {
    this.#ground.dispose();
    this.#shade.geometry.dispose();
    this.#shade.material.dispose();
    this.#key.dispose();
    this.#sky.dispose();
    this.#rim.dispose();
    this.#clearLabels();
  }

  /** Millimetres along the two edges that face the first view. */
  #label(): void {
    this.#clearLabels();
    if (this.#colours === undefined) return;
    const gap = LABEL_HEIGHT_MM * 1.3;
    const { text } = this.#colours;
    for (let x = 0; x <= this.#size.x; x += LABEL_EVERY_MM) this.#labels.push(flatText(String(x), text, x, -gap));
    for (let y = LABEL_EVERY_MM; y <= this.#size.y; y += LABEL_EVERY_MM) {
      this.#labels.push(flatText(String(y), text, this.#size.x + gap, y));
    }
    this.#labels.push(flatText("x, mm", text, this.#size.x / 2, -2.6 * gap));
    this.#labels.push(flatText("y", text, this.#size.x + 2.4 * gap, this.#size.y / 2));
    this.group.add(...this.#labels);
  }

  #clearLabels(): void {
    for (const { geometry, material } of this.#labels) {
      geometry.dispose();
      material.map?.dispose();
      material.dispose();
    }
    this.group.remove(...this.#labels);
    this.#labels = [];
  }
}

type FlatText = THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;

/** Text that lies on the ground, centred at (x, y) mm. */
function flatText(text: string, colour: string, x: number, y: number): FlatText {
  const canvas = document.createElement("canvas");
  const [height, font] = [64, "600 44px system-ui, sans-serif"];
  const context = canvas.getContext("2d");
  if (context !== null) {
    context.font = font;
    canvas.width = Math.ceil(context.measureText(text).width) + 16;
    canvas.height = height;
    context.font = font;
    context.fillStyle = colour;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, canvas.width / 2, height / 2);
  }
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  map.anisotropy = 8;
  const material = new THREE.MeshBasicMaterial({ map, transparent: true, depthWrite: false, toneMapped: false });
  const geometry = new THREE.PlaneGeometry((LABEL_HEIGHT_MM * canvas.width) / height, LABEL_HEIGHT_MM);
  const mesh = new THREE.Mesh(geometry, material);
  mesh.position.set(x, y, 0);
  return mesh;
}
