// Where the robot reaches, and how evenly it moves there: the hull of the reachable cells as points, and one level
// slice.

import * as THREE from "three";

/** Dexterity of cells: 0 at a singularity … 1 best, nothing out of reach. x fastest, then y, then z. */
export interface Workspace {
  readonly low_m: readonly [number, number, number];
  readonly high_m: readonly [number, number, number];
  readonly cells: readonly [number, number, number];
  readonly dexterity: readonly (number | null)[];
}

/** Colours from singular to best, evenly spaced, as CSS writes them. */
export type Ramp = readonly string[];

const POINT_MM = 3.2;

export class WorkspaceModel {
  readonly group = new THREE.Group();
  readonly #points: THREE.Points<THREE.BufferGeometry, THREE.PointsMaterial>;
  readonly #slice: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;
  #texture: THREE.DataTexture | undefined;
  #workspace: Workspace | undefined;
  #layer: number | undefined;
  /** Height of the slice. */
  #z_m = 0;
  #ramp: readonly THREE.Color[] = [new THREE.Color(0.5, 0.5, 0.5)];

  constructor() {
    this.#points = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({
      size: POINT_MM, vertexColors: true, transparent: true, opacity: 0.38, depthWrite: false, toneMapped: false,
    }));
    this.#slice = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), new THREE.MeshBasicMaterial({
      transparent: true, opacity: 0.62, depthWrite: false, side: THREE.DoubleSide, toneMapped: false,
    }));
    this.#points.frustumCulled = false;
    this.#slice.visible = false;
    this.group.add(this.#points, this.#slice);
  }

  setColours(ramp: Ramp): void {
    this.#ramp = ramp.map((colour) => new THREE.Color(colour));
    this.#rebuild();
  }

  set(workspace: Workspace | undefined): void {
    this.#workspace = workspace;
    this.#rebuild();
  }

  show(what: "hull" | "slice" | "nothing"): void {
    this.#points.visible = what === "hull";
    this.#slice.visible = what === "slice" && this.#workspace !== undefined;
  }

  /** Moves the slice to the layer of cells at a height. */
  slideTo(z_m: number): void {
    this.#z_m = z_m;
    const workspace = this.#workspace;
    if (workspace === undefined) return;
    const { low_m, high_m, cells: [, , nz] } = workspace;
    const share = (z_m - low_m[2]) / (high_m[2] - low_m[2]);
    const layer = Math.min(Math.max(Math.floor(share * nz), 0), nz - 1);
    this.#slice.position.z = 1000 * z_m;
    if (layer === this.#layer) return;
    this.#layer = layer;
    this.#paint(workspace, layer);
  }

  dispose(): void {
    this.#points.geometry.dispose();
    this.#points.material.dispose();
    this.#slice.geometry.dispose();
    this.#slice.material.dispose();
    this.#texture?.dispose();
  }

  #rebuild(): void {
    this.#layer = undefined;
    const workspace = this.#workspace;
    if (workspace === undefined) return;
    const positions: number[] = [];
    const colours: number[] = [];
    for (const { at_m, dexterity } of hullOf(workspace)) {
      positions.push(...at_m.map((metres) => 1000 * metres));
      colours.push(...this.#colour(dexterity).toArray());
    }
    this.#points.geometry.dispose();
    this.#points.geometry = new THREE.BufferGeometry();
    this.#points.geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    this.#points.geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
    const { low_m, high_m } = workspace;
    this.#slice.scale.set(1000 * (high_m[0] - low_m[0]), 1000 * (high_m[1] - low_m[1]), 1);
    this.#slice.position.set(500 * (high_m[0] + low_m[0]), 500 * (high_m[1] + low_m[1]), this.#slice.position.z);
    // The platform may rest where it is for long.
    this.slideTo(this.#z_m);
  }

  #paint({ cells: [nx, ny], dexterity }: Workspace, layer: number): void {
    const pixels = new Uint8Array(4 * nx * ny);
    for (let i = 0; i < nx * ny; i += 1) {
      const value = dexterity[i + nx * ny * layer];
      // Out of reach it is clear, and of the colour of the rim, so that none other shows where the two are blended.
      const { r, g, b } = this.#colour(value ?? 0).convertLinearToSRGB();
      pixels.set([255 * r, 255 * g, 255 * b, value === null ? 0 : 255], 4 * i);
    }
    this.#texture?.dispose();
    this.#texture = new THREE.DataTexture(pixels, nx, ny);
    this.#texture.colorSpace = THREE.SRGBColorSpace;
    this.#texture.magFilter = THREE.LinearFilter;
    this.#texture.needsUpdate = true;
    this.#slice.material.map = this.#texture;
    this.#slice.material.needsUpdate = true;
  }

  #colour(dexterity: number): THREE.Color {
    const at = Math.min(Math.max(dexterity, 0), 1) * (this.#ramp.length - 1);
    const n = Math.min(Math.floor(at), this.#ramp.length - 2);
    if (n < 0) return this.#ramp[0].clone();
    return this.#ramp[n].clone().lerp(this.#ramp[n + 1], at - n);
  }
}

/** Centres of reachable cells with a neighbour that is not. */
export function hullOf({ low_m, high_m, cells, dexterity }: Workspace): { at_m: [number, number, number]; dexterity: number }[] {
  const [nx, ny, nz] = cells;
  const at = (x: number, y: number, z: number): number | null =>
    x < 0 || y < 0 || z < 0 || nx <= x || ny <= y || nz <= z ? null : dexterity[x + nx * (y + ny * z)];
  const hull: { at_m: [number, number, number]; dexterity: number }[] = [];
  for (let z = 0; z < nz; z += 1) {
    for (let y = 0; y < ny; y += 1) {
      for (let x = 0; x < nx; x += 1) {
        const here = at(x, y, z);
        if (here === null) continue;
        const around = [at(x - 1, y, z), at(x + 1, y, z), at(x, y - 1, z), at(x, y + 1, z), at(x, y, z - 1), at(x, y, z + 1)];
        if (!around.includes(null)) continue;
        const centre = (n: number, axis: 0 | 1 | 2): number => low_m[axis] + ((n + 0.5) / cells[axis]) * (high_m[axis] - low_m[axis]);
        hull.push({ at_m: [centre(x, 0), centre(y, 1), centre(z, 2)], dexterity: here });
      }
    }
  }
  return hull;
}
