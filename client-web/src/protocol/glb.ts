// A surface of clay as the server writes it in binary glTF 2.0: indexed triangles under the transforms of its nodes.
// The page reads what a surface needs and passes over the rest.

import * as v from "valibot";
import { DecodeError } from "./header";

/** Triangles, counter-clockwise seen from the air. */
export interface Surface {
  /** Three per vertex, m, in the clay's own frame, whose z points up. */
  readonly positions: Float32Array<ArrayBuffer>;
  /** Three per triangle. */
  readonly indices: Uint32Array<ArrayBuffer>;
}

/** The bytes "glTF", "JSON" and "BIN\0". */
const MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BINARY_CHUNK = 0x004e4942;
const HEADER_BYTES = 12;
const CHUNK_HEADER_BYTES = 8;

/** What glTF calls componentType. */
const UINT16 = 5123;
const UINT32 = 5125;
const FLOAT32 = 5126;
/** What it calls mode, and takes where none is said. */
const TRIANGLES = 4;

const index = v.pipe(v.number(), v.integer(), v.minValue(0));
const several = <S extends v.GenericSchema>(schema: S): v.OptionalSchema<v.ArraySchema<S, undefined>, never[]> => v.optional(v.array(schema), []);
const numbers = (count: number): v.GenericSchema<unknown, number[]> => v.pipe(v.array(v.number()), v.length(count));

const document = v.object({
  scene: v.optional(index, 0),
  scenes: several(v.object({ nodes: several(index) })),
  nodes: several(v.object({
    mesh: v.optional(index),
    children: several(index),
    matrix: v.optional(numbers(16)),
    translation: v.optional(numbers(3), [0, 0, 0]),
    rotation: v.optional(numbers(4), [0, 0, 0, 1]),
    scale: v.optional(numbers(3), [1, 1, 1]),
  })),
  meshes: several(v.object({
    primitives: v.array(v.object({ attributes: v.object({ POSITION: index }), indices: index, mode: v.optional(v.number(), TRIANGLES) })),
  })),
  accessors: several(v.object({
    bufferView: index, byteOffset: v.optional(index, 0), componentType: v.number(), count: index, type: v.string(),
  })),
  bufferViews: several(v.object({ byteOffset: v.optional(index, 0), byteLength: index, byteStride: v.optional(index) })),
});
type Document = v.InferOutput<typeof document>;
type Node = Document["nodes"][number];

/** Column by column, as glTF writes matrices. */
type Matrix = readonly number[];
/** glTF's y points up and its z to the front: (x, y, z) there is (x, −z, y) in the clay's frame. */
const CLAY_FROM_GLTF: Matrix = [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1];

/** The surface in a file; throws what is none. */
export function decodeGlb(file: ArrayBuffer): Surface {
  const { json, binary } = chunksOf(file);
  const parts: Surface[] = [];
  const visit = (number: number, above: Matrix, depth: number): void => {
    const node = at(json.nodes, number, "node");
    if (json.nodes.length < depth) throw new DecodeError(`node ${number} stands below itself`);
    const clay_from_node = product(above, matrixOf(node));
    if (node.mesh !== undefined) {
      for (const primitive of at(json.meshes, node.mesh, "mesh").primitives) {
        if (primitive.mode !== TRIANGLES) throw new DecodeError(`mode is ${primitive.mode}, this page reads triangles, ${TRIANGLES}`);
        const positions = floatsOf(json, binary, primitive.attributes.POSITION);
        transform(positions, clay_from_node);
        parts.push({ positions, indices: indicesOf(json, binary, primitive.indices, positions.length / 3) });
      }
    }
    for (const child of node.children) visit(child, clay_from_node, depth + 1);
  };
  for (const root of json.scenes.at(json.scene)?.nodes ?? []) visit(root, CLAY_FROM_GLTF, 1);
  return parts.length === 1 ? parts[0] : joined(parts);
}

function chunksOf(file: ArrayBuffer): { json: Document; binary: DataView } {
  const bytes = new DataView(file);
  if (bytes.byteLength < HEADER_BYTES) throw new DecodeError(`file has ${bytes.byteLength} bytes, its header needs ${HEADER_BYTES}`);
  const magic = bytes.getUint32(0, true);
  if (magic !== MAGIC) throw new DecodeError(`magic is 0x${magic.toString(16)}, not 0x${MAGIC.toString(16)}`);
  const version = bytes.getUint32(4, true);
  if (version !== 2) throw new DecodeError(`version is ${version}, this page reads 2`);
  let [text, binary] = ["", new DataView(new ArrayBuffer(0))];
  for (let from = HEADER_BYTES; from + CHUNK_HEADER_BYTES <= bytes.byteLength;) {
    const [length, kind] = [bytes.getUint32(from, true), bytes.getUint32(from + 4, true)];
    const start = from + CHUNK_HEADER_BYTES;
    if (bytes.byteLength < start + length) throw new DecodeError(`chunk of ${length} bytes, ${bytes.byteLength - start} are there`);
    if (kind === JSON_CHUNK) text = new TextDecoder().decode(new Uint8Array(file, start, length));
    else if (kind === BINARY_CHUNK) binary = new DataView(file, start, length);
    from = start + length;
  }
  return { json: documentIn(text), binary };
}

function documentIn(text: string): Document {
  let json: unknown;
  try {
    json = JSON.parse(text);
  } catch {
    throw new DecodeError(`not JSON: ${text.slice(0, 80)}`);
  }
  const result = v.safeParse(document, json);
  if (result.success) return result.output;
  throw new DecodeError(`${v.getDotPath(result.issues[0]) ?? "glTF"}: ${result.issues[0].message}`);
}

/** Where an accessor's elements lie: the first, and how far apart, bytes. All of them are within the file. */
function placeOf(json: Document, binary: DataView, number: number, element_bytes: number): { start: number; stride: number; count: number } {
  const accessor = at(json.accessors, number, "accessor");
  const view = at(json.bufferViews, accessor.bufferView, "bufferView");
  const start = view.byteOffset + accessor.byteOffset;
  const stride = view.byteStride ?? element_bytes;
  const end = 0 < accessor.count ? start + stride * (accessor.count - 1) + element_bytes : start;
  if (binary.byteLength < end) throw new DecodeError(`accessor ${number} ends at byte ${end} of ${binary.byteLength}`);
  return { start, stride, count: accessor.count };
}

function floatsOf(json: Document, binary: DataView, number: number): Float32Array<ArrayBuffer> {
  const { componentType, type } = at(json.accessors, number, "accessor");
  if (componentType !== FLOAT32 || type !== "VEC3") throw new DecodeError(`positions are ${type} of ${componentType}, not VEC3 of ${FLOAT32}`);
  const { start, stride, count } = placeOf(json, binary, number, 12);
  const values = new Float32Array(3 * count);
  for (let n = 0; n < count; n += 1) {
    for (let axis = 0; axis < 3; axis += 1) values[3 * n + axis] = binary.getFloat32(start + stride * n + 4 * axis, true);
  }
  return values;
}

function indicesOf(json: Document, binary: DataView, number: number, vertices: number): Uint32Array<ArrayBuffer> {
  const { componentType, type } = at(json.accessors, number, "accessor");
  if ((componentType !== UINT16 && componentType !== UINT32) || type !== "SCALAR") {
    throw new DecodeError(`indices are ${type} of ${componentType}, not SCALAR of ${UINT16} or ${UINT32}`);
  }
  const { start, stride, count } = placeOf(json, binary, number, componentType === UINT16 ? 2 : 4);
  if (count % 3 !== 0) throw new DecodeError(`${count} indices are no whole triangles`);
  const values = new Uint32Array(count);
  for (let n = 0; n < count; n += 1) {
    const place = start + stride * n;
    values[n] = componentType === UINT16 ? binary.getUint16(place, true) : binary.getUint32(place, true);
    if (vertices <= values[n]) throw new DecodeError(`index ${values[n]} of ${vertices} vertices`);
  }
  return values;
}

function at<T>(list: readonly T[], number: number, what: string): T {
  if (number < list.length) return list[number];
  throw new DecodeError(`${what} ${number} of ${list.length}`);
}

function matrixOf({ matrix, translation: t, rotation: [x, y, z, w], scale: [a, b, c] }: Node): Matrix {
  if (matrix !== undefined) return matrix;
  return [
    a * (1 - 2 * (y * y + z * z)), a * 2 * (x * y + z * w), a * 2 * (x * z - y * w), 0,
    b * 2 * (x * y - z * w), b * (1 - 2 * (x * x + z * z)), b * 2 * (y * z + x * w), 0,
    c * 2 * (x * z + y * w), c * 2 * (y * z - x * w), c * (1 - 2 * (x * x + y * y)), 0,
    ...t, 1,
  ];
}

function product(a: Matrix, b: Matrix): Matrix {
  return Array.from({ length: 16 }, (_, n) => {
    const [row, column] = [n % 4, n - (n % 4)];
    return a[row] * b[column] + a[row + 4] * b[column + 1] + a[row + 8] * b[column + 2] + a[row + 12] * b[column + 3];
  });
}

function transform(positions: Float32Array, m: Matrix): void {
  for (let n = 0; n < positions.length; n += 3) {
    const [x, y, z] = [positions[n], positions[n + 1], positions[n + 2]];
    for (let axis = 0; axis < 3; axis += 1) positions[n + axis] = m[axis] * x + m[axis + 4] * y + m[axis + 8] * z + m[axis + 12];
  }
}

function joined(parts: readonly Surface[]): Surface {
  const total = (of: (part: Surface) => number): number => parts.reduce((sum, part) => sum + of(part), 0);
  const positions = new Float32Array(total((part) => part.positions.length));
  const indices = new Uint32Array(total((part) => part.indices.length));
  let [vertex, corner] = [0, 0];
  for (const part of parts) {
    positions.set(part.positions, 3 * vertex);
    indices.set(part.indices.map((n) => n + vertex), corner);
    vertex += part.positions.length / 3;
    corner += part.indices.length;
  }
  return { positions, indices };
}
