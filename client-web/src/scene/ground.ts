// The ground: a grid of 10 mm with every fifth line stronger.

import * as THREE from "three";

/** Colours of one theme, as CSS writes them. */
export interface StageColours {
  readonly background: string;
  readonly ground: string;
  readonly line: string;
  readonly text: string;
}

export interface Ground {
  readonly object: THREE.Object3D;
  colour(colours: StageColours): void;
  dispose(): void;
}

const SMOOTH_MM = 900;
const LINES_MM = 400;
const STEP_MM = 10;
const STRONG_MM = 50;
/** The colours that the smooth ground is drawn with. */
const SMOOTH_COLOURS = ["ground", "line", "background"] as const;
type SmoothColours = Readonly<Record<(typeof SMOOTH_COLOURS)[number], THREE.Color>>;

/** Fades into the background; lines keep their width on screen. Costs every pixel of the ground. */
export class SmoothGround implements Ground {
  readonly object: THREE.Mesh<THREE.PlaneGeometry, THREE.ShaderMaterial>;
  /** A picture may be drawn before it is told its colours, and a colour that is none ends the drawing. */
  readonly #colours: SmoothColours = { ground: new THREE.Color(), line: new THREE.Color(), background: new THREE.Color() };

  constructor() {
    this.object = new THREE.Mesh(new THREE.PlaneGeometry(SMOOTH_MM, SMOOTH_MM), smoothMaterial(this.#colours));
  }

  colour(colours: StageColours): void {
    for (const name of SMOOTH_COLOURS) this.#colours[name].set(colours[name]);
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}

/** Nothing but lines. */
export class LineGround implements Ground {
  readonly object = new THREE.Group();
  readonly #parts = [lines((n) => n % (STRONG_MM / STEP_MM) !== 0), lines((n) => n % (STRONG_MM / STEP_MM) === 0)] as const;

  constructor() {
    this.object.add(...this.#parts);
  }

  colour(colours: StageColours): void {
    const [weak, strong] = this.#parts;
    weak.material.color.set(colours.line).lerp(new THREE.Color(colours.background), 0.55);
    strong.material.color.set(colours.line);
  }

  dispose(): void {
    for (const { geometry, material } of this.#parts) {
      geometry.dispose();
      material.dispose();
    }
  }
}

/** The lines both ways whose number is wanted, counted from the middle. */
function lines(wanted: (n: number) => boolean): THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial> {
  const half = LINES_MM / 2;
  const points: THREE.Vector3[] = [];
  for (let n = -half / STEP_MM; n <= half / STEP_MM; n += 1) {
    if (!wanted(n)) continue;
    const at = n * STEP_MM;
    points.push(new THREE.Vector3(at, -half, 0), new THREE.Vector3(at, half, 0));
    points.push(new THREE.Vector3(-half, at, 0), new THREE.Vector3(half, at, 0));
  }
  return new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ toneMapped: false }));
}

function smoothMaterial({ ground, line, background }: SmoothColours): THREE.ShaderMaterial {
  return new THREE.ShaderMaterial({
    uniforms: { ground: { value: ground }, line: { value: line }, background: { value: background } },
    vertexShader: /* glsl */ `
      varying vec2 place;
      varying vec2 fromCentre;
      void main() {
        vec4 world = modelMatrix * vec4(position, 1.0);
        place = world.xy;
        fromCentre = position.xy;
        gl_Position = projectionMatrix * viewMatrix * world;
      }`,
    fragmentShader: /* glsl */ `
      uniform vec3 ground, line, background;
      varying vec2 place, fromCentre;
      float lines(float every) {
        vec2 at = place / every;
        vec2 width = fwidth(at);
        vec2 near = abs(fract(at - 0.5) - 0.5) / max(width, 1e-6);
        float dense = clamp(1.0 - 2.0 * max(width.x, width.y), 0.0, 1.0);
        return (1.0 - min(min(near.x, near.y), 1.0)) * dense;
      }
      void main() {
        float strength = max(0.45 * lines(${STEP_MM.toFixed(1)}), lines(${STRONG_MM.toFixed(1)}));
        float fade = smoothstep(${(SMOOTH_MM / 2).toFixed(1)}, 90.0, length(fromCentre));
        gl_FragColor = vec4(mix(background, mix(ground, line, strength), fade), 1.0);
        #include <colorspace_fragment>
      }`,
  });
}
