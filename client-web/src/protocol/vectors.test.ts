// The vectors that every language decodes and writes again, byte for byte.

import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { type BricksMessage, decodeBricks, encodeBricks } from "./bricks";
import { DecodeError, decodeHeader, Kind } from "./header";
import { pack, unpack } from "./packing";
import { CHANNELS, Channel, decodeTelemetry, encodeTelemetry } from "./telemetry";
import { decodeClientText, decodeServerText, encodeText } from "./text";

interface Vectors<Case> {
  readonly cases: Case[];
}
type Runs = [number, number][];
type Channels = Record<keyof typeof Channel, unknown>;

describe("the vectors", () => {
  it("of telemetry", () => {
    const { cases } = load<{ name: string; hex: string; value: { samples: Channels[] } & Record<string, unknown> }>("telemetry");
    expect(cases.length).toBeGreaterThan(1);
    for (const { name, hex, value } of cases) {
      const batch = decodeTelemetry(bytes(hex));
      expect(hexOf(encodeTelemetry(batch)), name).toBe(hex);
      const { samples, ...rest } = value;
      expect({ ...batch, values: undefined }, name).toEqual({ ...rest, values: undefined });
      expect(batch.values.length, name).toBe(CHANNELS * samples.length);
      samples.forEach((sample, n) => {
        for (const [channel, wanted] of Object.entries(sample)) {
          const at = CHANNELS * n + Channel[channel as keyof typeof Channel];
          [wanted].flat().forEach((number, axis) => expect(batch.values[at + axis], `${name} ${channel}`).toEqual(Number(number)));
        }
      });
    }
  });

  it("of bricks", () => {
    const { cases } = load<{ name: string; hex: string; value: BricksValue }>("bricks");
    expect(cases.length).toBeGreaterThan(2);
    for (const { name, hex, value } of cases) {
      const message = decodeBricks(bytes(hex));
      expect(plain(message), name).toEqual(plain(fromVector(value)));
      expect(hexOf(encodeBricks(message)), name).toBe(hex);
    }
  });

  it("of packed bricks, those packed by another writer too", () => {
    const { cases, other_tokens } = load<PackedCase>("packed_bricks") as Vectors<PackedCase> & { other_tokens: PackedCase[] };
    for (const { name, hex, voxel_runs } of cases) {
      const voxels = unpack(new Uint8Array(bytes(hex)));
      expect(voxels, name).toEqual(expand(voxel_runs));
      expect(hexOf(pack(voxels).buffer), name).toBe(hex);
    }
    expect(other_tokens.length).toBeGreaterThan(0);
    for (const { name, hex, voxel_runs } of other_tokens) {
      expect(unpack(new Uint8Array(bytes(hex))), name).toEqual(expand(voxel_runs));
    }
  });

  it("of text, both ways", () => {
    const server = load<{ name: string; value: unknown }>("server_texts").cases;
    for (const { name, value } of server) {
      expect(JSON.parse(encodeText(decodeServerText(JSON.stringify(value)))), name).toEqual(value);
    }
    const client = load<{ name: string; value: unknown }>("client_texts").cases;
    for (const { name, value } of client) {
      expect(JSON.parse(encodeText(decodeClientText(JSON.stringify(value)))), name).toEqual(value);
    }
  });

  it("of what must be refused", () => {
    const { cases } = load<{ name: string; decoder: string; hex: string }>("refused");
    const watched = cases.filter(({ decoder }) => decoder === "watch" || decoder === "packed");
    expect(watched.length).toBeGreaterThan(10);
    for (const { name, decoder, hex } of watched) {
      const decode = (): unknown => (decoder === "packed" ? unpack(new Uint8Array(bytes(hex))) : decodeAny(bytes(hex)));
      expect(decode, name).toThrow(DecodeError);
    }
  });
});

describe("bytes that went wrong on the way", () => {
  it("are decoded or refused, and never anything else", () => {
    const messages = ["telemetry", "bricks"].flatMap((name) => load<{ hex: string }>(name).cases.map(({ hex }) => hex));
    let seed = 11;
    const random = (below: number): number => {
      seed = (Math.imul(seed, 1103515245) + 12345) & 0x7fffffff;
      return (seed >>> 8) % below;
    };
    const outcomes = { decoded: 0, refused: 0 };
    for (let n = 0; n < 20_000; n += 1) {
      const message = new Uint8Array(bytes(messages[random(messages.length)]));
      for (let flips = random(4); 0 <= flips; flips -= 1) message[random(message.length)] = random(256);
      const cut = random(3) === 0 ? message.slice(0, random(message.length)) : message;
      try {
        decodeAny(cut.buffer);
        outcomes.decoded += 1;
      } catch (error) {
        expect(error).toBeInstanceOf(DecodeError);
        outcomes.refused += 1;
      }
    }
    expect(outcomes.decoded).toBeGreaterThan(1000);
    expect(outcomes.refused).toBeGreaterThan(1000);
  });
});

describe("text that is not a message", () => {
  it("is refused with the place that is wrong", () => {
    expect(() => decodeServerText("{")).toThrow(/not JSON/);
    expect(() => decodeServerText('{"type":"gossip"}')).toThrow(DecodeError);
    expect(() => decodeServerText('{"type":"pong","nonce":"7"}')).toThrow(/nonce/);
  });
});

interface PackedCase {
  readonly name: string;
  readonly hex: string;
  readonly voxel_runs: Runs;
}

interface BricksValue extends Omit<BricksMessage, "bricks"> {
  readonly bricks: { index: number; kind: "empty" | "full" | "packed"; voxel_runs?: Runs }[];
}

function load<Case>(name: string): Vectors<Case> {
  return JSON.parse(readFileSync(new URL(`../../../proto/vectors/${name}.json`, import.meta.url), "utf8")) as Vectors<Case>;
}

function fromVector(value: BricksValue): BricksMessage {
  return {
    ...value,
    bricks: value.bricks.map(({ index, kind, voxel_runs }) => ({
      index,
      content: kind === "packed" ? expand(voxel_runs ?? []) : kind,
    })),
  };
}

/** Voxels as text: comparing thousands of numbers one by one is slow. */
function plain(message: BricksMessage): unknown {
  return {
    ...message,
    bricks: message.bricks.map(({ index, content }) => ({ index, content: typeof content === "string" ? content : content.join() })),
  };
}

function expand(runs: Runs): Uint8Array {
  return Uint8Array.from(runs.flatMap(([count, value]) => new Array<number>(count).fill(value)));
}

function decodeAny(buffer: ArrayBuffer): unknown {
  return decodeHeader(new DataView(buffer)).kind === Kind.bricks ? decodeBricks(buffer) : decodeTelemetry(buffer);
}

function bytes(hex: string): ArrayBuffer {
  return Uint8Array.from(hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16)).buffer;
}

function hexOf(buffer: ArrayBuffer): string {
  return Buffer.from(buffer).toString("hex");
}
