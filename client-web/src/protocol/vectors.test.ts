// The vectors that every language decodes and writes again, byte for byte.

import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import { builtModule } from "./built_module";
import { DecodeError, decodeHeader, Kind } from "./header";
import { ModuleRefusal } from "./instance";
import type { PageModule } from "./module";
import { CHANNELS, Channel, decodeTelemetry, encodeTelemetry } from "./telemetry";
import { decodeHandAnswer } from "./operate";
import { decodeClientText, decodeServerText, encodeText } from "./text";

interface Vectors<Case> {
  readonly cases: Case[];
}
type Runs = [number, number][];
type Channels = Record<keyof typeof Channel, unknown>;

let module: PageModule;
beforeAll(async () => {
  module = await builtModule();
});

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

  it("of bricks, by the module: the grid, and of each brick the mean of every block of 4³ voxels", async () => {
    const { cases } = load<{ name: string; hex: string; value: BricksValue }>("bricks");
    expect(cases.length).toBeGreaterThan(2);
    let seen = 0;
    for (const { name, hex, value } of cases) {
      // Of a mirror that held nothing before, every brick is found.
      const fresh = await builtModule();
      fresh.takeInBricks(bytes(hex));
      const { clay_epoch, voxel_size_m, bricks_per_axis } = value;
      expect(fresh.describeClay(), name).toMatchObject({ epoch: clay_epoch, voxel_size_m, bricks_per_axis });
      const coarse = new Map<number, Uint8Array>();
      for (let brick = fresh.meshNextBrick(); brick !== undefined; brick = fresh.meshNextBrick()) coarse.set(brick.index, brick.coarse);
      for (const { index, kind, voxel_runs } of value.bricks) {
        const voxels = kind === "packed" ? expand(voxel_runs ?? []) : new Uint8Array(4096).fill(kind === "full" ? 255 : 0);
        expect([...(coarse.get(index) ?? [])], `${name}, brick ${index}`).toEqual(blockMeans(voxels));
        seen += 1;
      }
    }
    expect(seen).toBeGreaterThan(3);
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

  it("of hands", () => {
    const { from_the_server: answers } = JSON.parse(readFileSync(new URL("../../../proto/vectors/hand_texts.json", import.meta.url), "utf8")) as {
      from_the_server: { name: string; value: { type: string } }[];
    };
    for (const { name, value } of answers) {
      const answer = decodeHandAnswer(JSON.stringify(value));
      expect(answer.type, name).toBe(value.type === "done" ? "other" : value.type);
      if (answer.type === "granted") expect([...answer.grant.keys], name).toEqual(Array.from({ length: 64 }, (_, n) => n));
    }
  });

  it("of what must be refused", () => {
    const { cases } = load<{ name: string; decoder: string; hex: string }>("refused");
    const watched = cases.filter(({ decoder }) => decoder === "watch");
    expect(watched.length).toBeGreaterThan(10);
    for (const { name, hex } of watched) expect(() => decodeAny(bytes(hex)), name).toThrow(expect.toSatisfy(isRefusal));
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
        expect(error).toSatisfy(isRefusal);
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

interface BricksValue {
  readonly clay_epoch: number;
  readonly voxel_size_m: number;
  readonly bricks_per_axis: number[];
  readonly bricks: { index: number; kind: "empty" | "full" | "packed"; voxel_runs?: Runs }[];
}

function load<Case>(name: string): Vectors<Case> {
  return JSON.parse(readFileSync(new URL(`../../../proto/vectors/${name}.json`, import.meta.url), "utf8")) as Vectors<Case>;
}

/** Means of the blocks, in their order. */
function blockMeans(voxels: Uint8Array): number[] {
  return Array.from({ length: 64 }, (_, block) => {
    let sum = 0;
    for (let n = 0; n < 64; n += 1) {
      const [x, y, z] = [4 * (block & 3) + (n & 3), 4 * ((block >> 2) & 3) + ((n >> 2) & 3), 4 * (block >> 4) + (n >> 4)];
      sum += voxels[x + 16 * (y + 16 * z)];
    }
    return Math.round(sum / 64);
  });
}

function expand(runs: Runs): Uint8Array {
  return Uint8Array.from(runs.flatMap(([count, value]) => new Array<number>(count).fill(value)));
}

/** As the page does: bricks go to the module, all else is read here. */
function decodeAny(buffer: ArrayBuffer): unknown {
  return decodeHeader(new DataView(buffer)).kind === Kind.bricks ? module.takeInBricks(buffer) : decodeTelemetry(buffer);
}

/** A trap of the module is none. */
function isRefusal(error: unknown): boolean {
  return error instanceof DecodeError || error instanceof ModuleRefusal;
}

function bytes(hex: string): ArrayBuffer {
  return Uint8Array.from(hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16)).buffer;
}

function hexOf(buffer: ArrayBuffer): string {
  return Buffer.from(buffer).toString("hex");
}
