import * as THREE from "three";
import { describe, expect, it } from "vitest";
import { decodeGlb } from "./glb";
import { DecodeError } from "./header";

interface Part {
  readonly json: object;
  readonly binary: ArrayBuffer;
}

/** A file by the letter of the specification: chunks padded to four bytes. */
function file({ json, binary }: Part): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(json));
  const padded = (length: number): number => Math.ceil(length / 4) * 4;
  const length = 12 + 8 + padded(text.length) + 8 + padded(binary.byteLength);
  const bytes = new DataView(new ArrayBuffer(length));
  [0x46546c67, 2, length, padded(text.length), 0x4e4f534a].forEach((word, n) => bytes.setUint32(4 * n, word, true));
  const all = new Uint8Array(bytes.buffer);
  all.fill(0x20, 20, 20 + padded(text.length));
  all.set(text, 20);
  const second = 20 + padded(text.length);
  bytes.setUint32(second, padded(binary.byteLength), true);
  bytes.setUint32(second + 4, 0x004e4942, true);
  all.set(new Uint8Array(binary), second + 8);
  return bytes.buffer;
}

const CORNERS = [[0, 0, 0], [128, 0, 0], [0, 64, 0], [0, 0, 32]];
const INDICES = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];

/** A tetrahedron, under whatever nodes a file has. */
function tetrahedron(nodes: readonly object[], indexType: 5123 | 5125 = 5125): Part {
  const indexBytes = (indexType === 5123 ? 2 : 4) * INDICES.length;
  const binary = new ArrayBuffer(48 + indexBytes);
  new Float32Array(binary, 0, 12).set(CORNERS.flat());
  if (indexType === 5123) new Uint16Array(binary, 48).set(INDICES);
  else new Uint32Array(binary, 48).set(INDICES);
  return {
    binary,
    json: {
      asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes,
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
      accessors: [
        { bufferView: 0, componentType: 5126, count: 4, type: "VEC3" },
        { bufferView: 1, componentType: indexType, count: INDICES.length, type: "SCALAR" },
      ],
      bufferViews: [{ buffer: 0, byteLength: 48 }, { buffer: 0, byteOffset: 48, byteLength: indexBytes }],
      buffers: [{ byteLength: binary.byteLength }],
    },
  };
}

/** Turns z up into y up, and millimetres into metres. */
const UP = { rotation: [-Math.SQRT1_2, 0, 0, Math.SQRT1_2], scale: [0.001, 0.001, 0.001] };

function near(got: ArrayLike<number>, want: readonly number[]): void {
  expect(got.length).toBe(want.length);
  want.forEach((value, n) => expect(got[n]).toBeCloseTo(value, 6));
}

describe("a surface in glTF", () => {
  it("comes out in the clay's own frame, in metres, whichever way the node turns it up", () => {
    const want = CORNERS.flat().map((mm) => mm / 1000);
    const s = 0.001;
    // The same turn as a matrix, column by column: x to x, y to −z, z to y.
    const matrix = [s, 0, 0, 0, 0, 0, -s, 0, 0, s, 0, 0, 0, 0, 0, 1];
    for (const nodes of [[{ mesh: 0, ...UP }], [{ mesh: 0, matrix }], [{ children: [1], rotation: UP.rotation }, { mesh: 0, scale: UP.scale }]]) {
      for (const type of [5123, 5125] as const) {
        const surface = decodeGlb(file(tetrahedron(nodes, type)));
        near(surface.positions, want);
        expect([...surface.indices]).toEqual(INDICES);
      }
    }
  });

  it("stands where three.js would put it, under any transforms", () => {
    const nodes = [
      { children: [1], translation: [0.1, -0.2, 0.3], rotation: [0.1, 0.7, -0.1, 0.7], scale: [1, 2, 0.5] },
      { mesh: 0, translation: [3, 4, 5], rotation: [0.5, 0.5, 0.5, 0.5], scale: [0.001, 0.001, 0.001] },
    ];
    const parent = new THREE.Group();
    const child = new THREE.Group();
    for (const [object, { translation, rotation, scale }] of [[parent, nodes[0]], [child, nodes[1]]] as const) {
      const [x, y, z, w] = rotation;
      object.position.set(translation[0], translation[1], translation[2]);
      object.quaternion.set(x, y, z, w);
      object.scale.set(scale[0], scale[1], scale[2]);
    }
    parent.add(child);
    parent.updateMatrixWorld(true);
    const want = CORNERS.flatMap(([x, y, z]) => {
      const at = new THREE.Vector3(x, y, z).applyMatrix4(child.matrixWorld);
      return [at.x, -at.z, at.y];
    });
    near(decodeGlb(file(tetrahedron(nodes))).positions, want);
  });

  it("may be none, where all clay is gone", () => {
    const { positions, indices } = decodeGlb(file({ json: { asset: { version: "2.0" }, scene: 0, scenes: [{}] }, binary: new ArrayBuffer(0) }));
    expect([positions.length, indices.length]).toEqual([0, 0]);
  });

  it("joins the meshes of several nodes", () => {
    const part = tetrahedron([{ mesh: 0, children: [1] }, { mesh: 0, translation: [1, 0, 0] }]);
    const { positions, indices } = decodeGlb(file(part));
    expect([positions.length, indices.length]).toEqual([24, 24]);
    expect([...indices.subarray(12)]).toEqual(INDICES.map((n) => n + 4));
  });

  it("is refused whatever is cut off, turned or torn, and never read beyond its end", () => {
    const whole = file(tetrahedron([{ mesh: 0, ...UP }]));
    for (let length = 0; length < whole.byteLength - 4; length += 1) expect(() => decodeGlb(whole.slice(0, length)), String(length)).toThrow(DecodeError);
    const { json, binary } = tetrahedron([{ mesh: 0 }]);
    const wrong = (change: object): (() => unknown) => () => decodeGlb(file({ json: { ...json, ...change }, binary }));
    expect(wrong({ nodes: [{ mesh: 7 }] })).toThrow("mesh 7 of 1");
    expect(wrong({ nodes: [{ children: [0] }] })).toThrow("stands below itself");
    expect(wrong({ bufferViews: [{ byteLength: 48 }, { byteOffset: 52, byteLength: 48 }] })).toThrow(/accessor 1 ends at byte 100 of 96/);
    expect(wrong({ meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1, mode: 1 }] }] })).toThrow("mode is 1");
    new Uint32Array(binary, 48)[3] = 4;
    expect(() => decodeGlb(file({ json, binary }))).toThrow("index 4 of 4 vertices");
  });
});
