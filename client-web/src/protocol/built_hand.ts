// The hand's module as a test has it: out of the file that `npm run module` made.

import { readFileSync } from "node:fs";
import { HandModule } from "./hand_module";

export async function builtHand(): Promise<HandModule> {
  const file = readFileSync(`${import.meta.dirname}/../../generated/hand.wasm`);
  return new HandModule((await WebAssembly.instantiate(file, {})).instance);
}

/** A stroke as hand/examples/stroke.rs recorded it. */
export interface Stroke {
  readonly keys: string;
  readonly granted: string;
  readonly wakes: readonly {
    readonly now_ms: number;
    readonly samples: readonly (readonly [number, number, number, number])[];
    readonly heard: readonly string[];
  }[];
}

export function recordedStroke(): Stroke {
  return JSON.parse(readFileSync(`${import.meta.dirname}/../../hand/vectors/stroke.json`, "utf8")) as Stroke;
}

export function bytesOf(hex: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
}
