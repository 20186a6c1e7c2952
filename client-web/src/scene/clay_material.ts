// How clay looks: matt, warm, darker where it was cut, and darkest where little of the sky is seen.

import * as THREE from "three";
import { COARSENESS } from "../clay/port";
import type { Quality } from "./quality";

/** What the material has to know about the block. Lengths in voxels, as the mesh has them. */
export interface Block {
  /** Size of the grid. */
  readonly size: THREE.Vector3;
  /** Heights of the fresh block's level faces, and where its steps stand along x: the rest has been cut. */
  readonly heights: readonly number[];
  readonly steps: readonly number[];
}

const PLANES = 8;

export interface ClayMaterial {
  readonly material: THREE.Material;
  setBlock(block: Block): void;
  setOccupancy(texture: THREE.Data3DTexture): void;
  dispose(): void;
}

export function clayMaterial(quality: Quality): ClayMaterial {
  const occupancy: { value: THREE.Data3DTexture | null } = { value: null };
  const uniforms = {
    gridSize: { value: new THREE.Vector3(1, 1, 1) },
    heights: { value: new Float32Array(PLANES).fill(NOWHERE) },
    steps: { value: new Float32Array(PLANES).fill(NOWHERE) },
    occupancy,
  };
  const material = quality === "fine"
    ? new THREE.MeshStandardMaterial({ color: 0xffffff, roughness: 0.92, metalness: 0 })
    : new THREE.MeshLambertMaterial({ color: 0xffffff });
  if (quality === "fine") material.defines = { ...material.defines, FINE: "" };
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", `#include <common>\n${VARYINGS}`)
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nclayPosition = position;\nclayNormal = normal;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", `#include <common>\n${VARYINGS}\n${FUNCTIONS}`)
      .replace("#include <color_fragment>", "#include <color_fragment>\ndiffuseColor.rgb *= clayColour();")
      .replace("#include <aomap_fragment>", "#include <aomap_fragment>\n" +
        "float openness = clayOpenness();\n" +
        "reflectedLight.indirectDiffuse *= openness;\n" +
        // Little sky means few bounces too: a cavity is darker than its shadow alone makes it.
        "reflectedLight.directDiffuse *= mix(0.75, 1.0, openness);");
  };
  return {
    material,
    setBlock: ({ size, heights, steps }) => {
      uniforms.gridSize.value.copy(size);
      fillPlanes(uniforms.heights.value, heights);
      fillPlanes(uniforms.steps.value, steps);
    },
    setOccupancy: (texture) => {
      uniforms.occupancy.value = texture;
    },
    dispose: () => material.dispose(),
  };
}

/** Farther than any face. */
const NOWHERE = -1e6;

function fillPlanes(to: Float32Array, planes: readonly number[]): void {
  to.fill(NOWHERE);
  to.set(planes.slice(0, PLANES));
}

const VARYINGS = "varying vec3 clayPosition;\nvarying vec3 clayNormal;";

const FUNCTIONS = /* glsl */ `
uniform vec3 gridSize;
uniform float heights[${PLANES}];
uniform float steps[${PLANES}];
uniform highp sampler3D occupancy;

float clayHash(vec3 p) {
  p = fract(p * 0.3183099 + 0.1);
  p *= 17.0;
  return fract(p.x * p.y * p.z * (p.x + p.y + p.z));
}

/* Smooth noise, 0 … 1. */
float clayNoise(vec3 p) {
  vec3 i = floor(p);
  vec3 f = fract(p);
  f = f * f * (3.0 - 2.0 * f);
  return mix(
    mix(mix(clayHash(i), clayHash(i + vec3(1, 0, 0)), f.x), mix(clayHash(i + vec3(0, 1, 0)), clayHash(i + vec3(1, 1, 0)), f.x), f.y),
    mix(mix(clayHash(i + vec3(0, 0, 1)), clayHash(i + vec3(1, 0, 1)), f.x), mix(clayHash(i + vec3(0, 1, 1)), clayHash(i + 1.0), f.x), f.y),
    f.z);
}

/* 1 on the skin of the fresh block, 0 where it was cut. */
float claySkin() {
  vec3 n = abs(clayNormal);
  vec3 p = clayPosition;
  float nearest = min(min(p.y, gridSize.y - p.y) + 4.0 * (1.0 - n.y), p.z + 4.0 * (1.0 - n.z));
  for (int i = 0; i < ${PLANES}; i++) {
    nearest = min(nearest, abs(p.z - heights[i]) + 4.0 * (1.0 - n.z));
    nearest = min(nearest, abs(p.x - steps[i]) + 4.0 * (1.0 - n.x));
  }
  return 1.0 - smoothstep(0.4, 1.4, nearest);
}

vec3 clayColour() {
  vec3 p = clayPosition;
#ifdef FINE
  float grain = clayNoise(p * 0.9) * 0.5 + clayNoise(p * 0.21) * 0.5;
#else
  float grain = 0.5;
#endif
  vec3 dry = vec3(0.60, 0.44, 0.345);
  vec3 fresh = vec3(0.46, 0.215, 0.13);
  return mix(fresh, dry, claySkin()) * (0.93 + 0.14 * grain);
}

float clayAt(vec3 p) {
  return texture(occupancy, (p / ${COARSENESS.toFixed(1)} + 1.0) / vec3(textureSize(occupancy, 0))).r;
}

/* Clay met on the way to the sky: along the normal, and leaning to four sides. */
float clayOpenness() {
  vec3 n = normalize(clayNormal);
#ifndef FINE
  return 1.0 - min(0.9 * clayAt(clayPosition + 9.0 * n) + 0.6 * clayAt(clayPosition + 18.0 * n), 0.8);
#endif
  vec3 u = 9.0 * normalize(abs(n.z) < 0.7 ? cross(n, vec3(0, 0, 1)) : cross(n, vec3(1, 0, 0)));
  vec3 w = cross(n, u);
  vec3 low = clayPosition + 8.0 * n;
  float hidden = 0.3 * clayAt(low) + 0.25 * clayAt(low + 10.0 * n);
  hidden += 0.24 * (clayAt(low + u) + clayAt(low - u) + clayAt(low + w) + clayAt(low - w));
  return 1.0 - min(hidden, 0.8);
}
`;
