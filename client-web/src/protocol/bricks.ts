// Clay on the wire: a brick is 16³ occupancies, x fastest, then y, then z; brick `x + nx·(y + ny·z)` of the grid.

import { DecodeError, encodeHeader, expectKind, HEADER_BYTES, Kind } from "./header";
import { pack, unpack } from "./packing";

const FIXED_BYTES = HEADER_BYTES + 20;
const BRICK_HEADER_BYTES = 8;
const KEYFRAME = 1;

const Form = { empty: 0, full: 1, packed: 2 } as const;

export interface BrickUpdate {
  readonly index: number;
  readonly content: "empty" | "full" | Uint8Array;
}

export interface BricksMessage {
  readonly sequence: number;
  /** Rises with every fresh block. */
  readonly clay_epoch: number;
  readonly bricks_per_axis: readonly [number, number, number];
  /** A keyframe starts here: bricks held before are to be forgotten, and what is not told from here on is empty. */
  readonly keyframe: boolean;
  readonly voxel_size_m: number;
  readonly bricks: readonly BrickUpdate[];
}

export function decodeBricks(buffer: ArrayBuffer): BricksMessage {
  const bytes = new DataView(buffer);
  const { sequence } = expectKind(bytes, Kind.bricks);
  if (bytes.byteLength < FIXED_BYTES) {
    throw new DecodeError(`bricks have ${bytes.byteLength} bytes, their fixed part needs ${FIXED_BYTES}`);
  }
  const flags = bytes.getUint16(18, true);
  if ((flags & ~KEYFRAME) !== 0) throw new DecodeError(`flags 0x${flags.toString(16)} are unknown`);
  const perAxis = [bytes.getUint16(12, true), bytes.getUint16(14, true), bytes.getUint16(16, true)] as const;
  const count = bytes.getUint32(24, true);
  const bricks: BrickUpdate[] = [];
  let at = FIXED_BYTES;
  for (let n = 0; n < count; n += 1) {
    const { update, next } = decodeBrick(bytes, at, perAxis[0] * perAxis[1] * perAxis[2]);
    bricks.push(update);
    at = next;
  }
  if (at !== bytes.byteLength) throw new DecodeError(`${bytes.byteLength - at} bytes follow the last brick`);
  return {
    sequence,
    clay_epoch: bytes.getUint32(8, true),
    bricks_per_axis: perAxis,
    keyframe: flags === KEYFRAME,
    voxel_size_m: bytes.getFloat32(20, true),
    bricks,
  };
}

function decodeBrick(bytes: DataView, at: number, bricksInGrid: number): { update: BrickUpdate; next: number } {
  if (bytes.byteLength < at + BRICK_HEADER_BYTES) throw new DecodeError("message ends inside a brick's header");
  const index = bytes.getUint32(at, true);
  if (bricksInGrid <= index) throw new DecodeError(`brick ${index} is outside a grid of ${bricksInGrid}`);
  const form = bytes.getUint8(at + 4);
  if (bytes.getUint8(at + 5) !== 0) throw new DecodeError(`brick ${index} uses a reserved byte`);
  const length = bytes.getUint16(at + 6, true);
  const body = at + BRICK_HEADER_BYTES;
  if (bytes.byteLength < body + length) throw new DecodeError(`message ends inside brick ${index}`);
  const next = body + length;
  if (form === Form.packed) {
    return { update: { index, content: unpack(new Uint8Array(bytes.buffer, bytes.byteOffset + body, length)) }, next };
  }
  if (form !== Form.empty && form !== Form.full) throw new DecodeError(`brick ${index} has unknown form ${form}`);
  if (length !== 0) throw new DecodeError(`uniform brick ${index} carries ${length} bytes`);
  return { update: { index, content: form === Form.empty ? "empty" : "full" }, next };
}

export function encodeBricks(message: BricksMessage): ArrayBuffer {
  const bodies = message.bricks.map(({ content }) => (content instanceof Uint8Array ? pack(content) : undefined));
  const size = bodies.reduce((sum, body) => sum + BRICK_HEADER_BYTES + (body?.length ?? 0), FIXED_BYTES);
  const out = new Uint8Array(size);
  const bytes = new DataView(out.buffer);
  encodeHeader(bytes, { kind: Kind.bricks, sequence: message.sequence });
  bytes.setUint32(8, message.clay_epoch, true);
  message.bricks_per_axis.forEach((n, axis) => bytes.setUint16(12 + 2 * axis, n, true));
  bytes.setUint16(18, message.keyframe ? KEYFRAME : 0, true);
  bytes.setFloat32(20, message.voxel_size_m, true);
  bytes.setUint32(24, message.bricks.length, true);
  let at = FIXED_BYTES;
  message.bricks.forEach(({ index, content }, n) => {
    const body = bodies[n];
    bytes.setUint32(at, index, true);
    bytes.setUint8(at + 4, body !== undefined ? Form.packed : content === "empty" ? Form.empty : Form.full);
    bytes.setUint16(at + 6, body?.length ?? 0, true);
    at += BRICK_HEADER_BYTES;
    if (body === undefined) return;
    out.set(body, at);
    at += body.length;
  });
  return out.buffer;
}

