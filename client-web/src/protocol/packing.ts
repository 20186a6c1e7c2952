// The packed form of a brick. A voxel is predicted by the one in the row before (16 earlier), which is right almost
// everywhere in clay; runs of right predictions are counted, the rest is sent as it is. Which zeros make a run is
// fixed, so that all writers give the same bytes: two or more.

import { DecodeError } from "./header";

export const BRICK_EDGE = 16;
export const BRICK_VOXELS = BRICK_EDGE ** 3;
const LONGEST = 128;

/** The residual at `i`: the voxel less its neighbour one row earlier, modulo 256. */
function residual(voxels: Uint8Array, i: number): number {
  return (voxels[i] - (i < BRICK_EDGE ? 0 : voxels[i - BRICK_EDGE])) & 0xff;
}

export function unpack(packed: Uint8Array): Uint8Array<ArrayBuffer> {
  const voxels = new Uint8Array(BRICK_VOXELS);
  let read = 0;
  let write = 0;
  const put = (r: number): void => {
    voxels[write] = r + (write < BRICK_EDGE ? 0 : voxels[write - BRICK_EDGE]);
    write += 1;
  };
  while (read < packed.length) {
    const token = packed[read];
    read += 1;
    const literal = token < LONGEST;
    const length = literal ? token + 1 : token - LONGEST + 1;
    if (BRICK_VOXELS < write + length) throw new DecodeError(`packed brick runs past ${BRICK_VOXELS} voxels`);
    if (literal && packed.length < read + length) throw new DecodeError("packed brick ends inside a literal");
    for (let k = 0; k < length; k += 1) put(literal ? packed[read + k] : 0);
    if (literal) read += length;
  }
  if (write !== BRICK_VOXELS) throw new DecodeError(`packed brick has ${write} voxels, not ${BRICK_VOXELS}`);
  return voxels;
}

export function pack(voxels: Uint8Array): Uint8Array<ArrayBuffer> {
  const packed: number[] = [];
  let i = 0;
  while (i < BRICK_VOXELS) {
    const zeros = zerosFrom(voxels, i);
    if (1 < zeros) {
      packed.push(LONGEST + zeros - 1);
      i += zeros;
      continue;
    }
    const start = i;
    while (i < BRICK_VOXELS && i - start < LONGEST && zerosFrom(voxels, i) < 2) i += 1;
    packed.push(i - start - 1);
    for (let k = start; k < i; k += 1) packed.push(residual(voxels, k));
  }
  return Uint8Array.from(packed);
}

/** How many residuals are zero from `i` on, as far as one token can say. */
function zerosFrom(voxels: Uint8Array, i: number): number {
  let n = 0;
  while (n < LONGEST && i + n < BRICK_VOXELS && residual(voxels, i + n) === 0) n += 1;
  return n;
}
