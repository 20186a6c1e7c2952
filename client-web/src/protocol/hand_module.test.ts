import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { builtHand, bytesOf, recordedStroke } from "./built_hand";
import { HandModule, handModuleFrom, isFrames } from "./hand_module";
import { ModuleRefusal } from "./instance";

const DEVICE = { rate_hz: 60, motion: 1 };

/** FNV-1a, 32 bits. */
function fold(digest: number, bytes: Uint8Array): number {
  return bytes.reduce((folded, byte) => Math.imul(folded ^ byte, 0x01000193), digest);
}

describe("the hand's module", () => {
  /** The digest is of native code: hand/tests/stroke.rs compares it with what Rust gives on this machine. */
  it("gives a recorded stroke the bits that native code gives it", async () => {
    const file = readFileSync(`${import.meta.dirname}/../../generated/hand.wasm`);
    const { instance } = await WebAssembly.instantiate(file, {});
    const module = new HandModule(instance);
    const exports = instance.exports as unknown as { memory: WebAssembly.Memory; address(n: number): number; length(n: number): number };
    const stroke = recordedStroke();
    module.begin(0, { keys: bytesOf(stroke.keys), granted: stroke.granted }, DEVICE);
    module.hold();
    let digest = 0x811c9dc5;
    for (const { now_ms, samples, heard } of stroke.wakes) {
      for (const [at_ms, ...position_m] of samples) module.tell(now_ms, at_ms, position_m);
      for (const message of heard) module.hear(now_ms, bytesOf(message).buffer);
      module.advance(now_ms);
      module.look();
      digest = fold(digest, module.outgoing() ?? new Uint8Array());
      const numbers = new Float64Array(exports.memory.buffer, exports.address(2), exports.length(2)).map((n) => (Number.isNaN(n) ? -1 : n));
      digest = fold(digest, new Uint8Array(numbers.buffer));
      module.tidy();
    }
    const wanted = (JSON.parse(readFileSync(`${import.meta.dirname}/../../hand/vectors/stroke.json`, "utf8")) as { digest: string }).digest;
    expect((digest >>> 0).toString(16).padStart(8, "0")).toBe(wanted);
    const state = module.look();
    expect(state).toMatchObject({ mode: "coupled", link: "live", grasp: "held", scheme: "force_exchange", copy: "none", clay_hash: undefined });
    expect(state?.counts).toMatchObject({ ticks: 1600, given_up: 0, unheard: 0, undecodable: 0 });
    expect(state?.wanted).toEqual({ parameters: false, lease: false, snapshot: undefined });
  });

  it("says in words what it refuses", async () => {
    const module = await builtHand();
    expect(() => module.hear(0, new ArrayBuffer(3))).toThrow(new ModuleRefusal("no grant was taken yet"));
    expect(() => module.begin(0, { keys: new Uint8Array(64), granted: "{}" }, DEVICE)).toThrow(/missing field/);
    expect([module.look(), module.outgoing(), module.due()]).toEqual([undefined, undefined, Infinity]);
    const stroke = recordedStroke();
    const grant = { keys: bytesOf(stroke.keys), granted: stroke.granted };
    expect(() => module.begin(0, grant, { rate_hz: 1, motion: 1 })).toThrow("the pointer is told 1 times a second, wanted 20 to 1000");
    module.begin(0, grant, DEVICE);
    expect(() => module.setMotion(1000)).toThrow(/motion scale is 1000/);
    expect(() => module.renew(0, grant)).toThrow(/another loop/);
    expect(() => module.takeSnapshot("{}", [])).toThrow(ModuleRefusal);
  });

  it("takes the clay in parts, in memory that grows meanwhile", async () => {
    const module = await builtHand();
    const stroke = recordedStroke();
    const granted = JSON.parse(stroke.granted) as { parameters: { scheme: string }; clay: object };
    granted.parameters.scheme = "replica";
    module.begin(0, { keys: bytesOf(stroke.keys), granted: JSON.stringify(granted) }, DEVICE);
    const clay = JSON.stringify({ ...granted.clay, shape: { kind: "block", size_m: [0.256, 0.256, 0.128] }, voxel_size_m: 0.001 });
    // A keyframe of 16 x 16 x 8 full bricks.
    const bricks = 16 * 16 * 8;
    const message = new DataView(new ArrayBuffer(28 + 8 * bricks));
    [0x54, 0x43, 1, 2].forEach((byte, at) => message.setUint8(at, byte));
    message.setUint32(8, 1, true);
    [16, 16, 8].forEach((count, axis) => message.setUint16(12 + 2 * axis, count, true));
    message.setUint16(18, 1, true);
    message.setFloat32(20, 0.001, true);
    message.setUint32(24, bricks, true);
    for (let index = 0; index < bricks; index++) {
      message.setUint32(28 + 8 * index, index, true);
      message.setUint8(32 + 8 * index, 1);
    }
    module.takeSnapshot(clay, [message.buffer]);
    module.advance(10);
    expect(module.look()).toMatchObject({ scheme: "replica", link: "not_yet", clay_epoch: 1 });
    expect(() => module.takeSnapshot(clay, [])).toThrow("2048 of 2048 bricks did not come");
  });

  it("is not taken for another module, and comes by a good answer alone", async () => {
    expect(() => new HandModule({ exports: {} })).toThrow("the module has no function address");
    await expect(handModuleFrom(Promise.resolve(new Response("", { status: 404 })))).rejects.toThrow("answers 404");
  });

  it("tells messages of frames from others by their kind", () => {
    const message = (...bytes: number[]): ArrayBuffer => Uint8Array.from(bytes).buffer;
    expect([message(0x54, 0x43, 1, 4), message(0x54, 0x43, 1, 2), message(), message(4)].map(isFrames)).toEqual([true, false, false, false]);
  });
});
