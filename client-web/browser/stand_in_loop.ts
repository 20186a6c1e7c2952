// The tool's end of the loop for a stand-in: a tool that is where its handle is, in something viscous. Written by
// proto/SPEC.md alone, sections 2, 4.2 and 6.3, and by nothing that a server or a handle is made of.

import { createHmac } from "node:crypto";

const SHARED_BYTES = 48;
const FRAME_BYTES = 232;
const TRAILER_BYTES = 24;
const TAG_BYTES = 16;
const FRAME_PURPOSE = 1;
const TOOL_FRAME = 2;
const RUNNING = 1;
const TOOL_MESSAGE = 4;
/** What the tool works in, N·s/m. */
const VISCOSITY = 40;
/** In a handle frame, and in a tool frame. */
const POSITION = 48;
const VELOCITY = 72;
const FORCE = 96;
const LEASE = 4;
const SEQUENCE = 8;
const SENT = 16;
const ECHO = 24;

export class StandInLoop {
  /** Where the tool is, m. */
  position_m: readonly number[];
  readonly #home_m: readonly number[];
  readonly #key: Buffer;
  #number = 0;
  #sequence = 0;
  #messages = 0;

  /** `key`: the server's, of the two that a lease has. */
  constructor(key: Uint8Array, home_m: readonly number[]) {
    this.#key = Buffer.from(key);
    this.#home_m = home_m;
    this.position_m = home_m;
  }

  /** What comes back for a message of handle frames: one tool frame, for the newest of them. */
  answer(message: Buffer): Buffer {
    const up = newestFrame(message);
    const down = Buffer.alloc(FRAME_BYTES);
    down.write("TF", "latin1");
    down.set([1, TOOL_FRAME], 2);
    up.copy(down, LEASE, LEASE, LEASE + 4);
    this.#sequence += 1;
    down.writeUInt32LE(this.#sequence, SEQUENCE);
    down.writeBigUInt64LE(process.hrtime.bigint(), SENT);
    up.copy(down, ECHO, SENT, SENT + 8);
    // Epochs, revision and scheme are the handle's own.
    up.copy(down, 32, 32, 45);
    down[45] = RUNNING;
    for (const [axis, home_m] of this.#home_m.entries()) {
      const velocity_m_s = up.readDoubleLE(VELOCITY + 8 * axis);
      down.writeDoubleLE(home_m + up.readDoubleLE(POSITION + 8 * axis), POSITION + 8 * axis);
      down.writeDoubleLE(velocity_m_s, VELOCITY + 8 * axis);
      down.writeDoubleLE(-VISCOSITY * velocity_m_s, FORCE + 8 * axis);
    }
    this.position_m = [0, 1, 2].map((axis) => down.readDoubleLE(POSITION + 8 * axis));
    down.writeUInt32LE(1, 224);
    return this.#message(Buffer.concat([down, this.#trailer(down)]));
  }

  #trailer(frame: Buffer): Buffer {
    this.#number += 1;
    const number = Buffer.alloc(8);
    number.writeBigUInt64LE(BigInt(this.#number));
    const tag = createHmac("sha256", this.#key).update(Buffer.from([FRAME_PURPOSE])).update(number).update(frame).digest();
    return Buffer.concat([number, tag.subarray(0, TAG_BYTES)]);
  }

  #message(sealed: Buffer): Buffer {
    const head = Buffer.alloc(14);
    head.write("TC", "latin1");
    head.set([1, TOOL_MESSAGE], 2);
    head.writeUInt32LE(this.#messages, 4);
    head.writeUInt16LE(1, 8);
    head.writeUInt16LE(sealed.length, 12);
    this.#messages += 1;
    return Buffer.concat([head, sealed]);
  }
}

function newestFrame(message: Buffer): Buffer {
  let at = 12;
  for (let left = message.readUInt16LE(8); 1 < left; left -= 1) at += 2 + message.readUInt16LE(at);
  const frame = message.subarray(at + 2, at + 2 + message.readUInt16LE(at) - TRAILER_BYTES);
  if (frame.length < SHARED_BYTES || frame.toString("latin1", 0, 2) !== "TF") throw new Error("a handle sent what is no frame");
  return frame;
}
