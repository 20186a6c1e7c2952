// The module of WebAssembly that is the mathematics of the Stability and the Robot page: no other page loads it.

import { computed, signal } from "@preact/signals";
import address from "../../generated/mathematics.wasm?url";
import { mathematicsFrom, type MathematicsModule } from "../protocol/mathematics";

const loaded = signal<{ readonly module?: MathematicsModule; readonly problem?: string }>({});

/** Nothing while it is on its way, and where it does not come. */
export const mathematics = computed((): MathematicsModule | undefined => loaded.value.module);

/** Why it did not come, as a sentence. */
export const mathematicsMissing = computed((): string | undefined => {
  const { problem } = loaded.value;
  return problem === undefined ? undefined : `This page cannot calculate, as its module did not load: ${problem}. Load the page again.`;
});

let isAsked = false;

/** To be called by whatever calculates; the first call loads the module. */
export async function loadMathematics(): Promise<void> {
  if (isAsked) return;
  isAsked = true;
  try {
    loaded.value = { module: await mathematicsFrom(fetch(address)) };
  } catch (error) {
    loaded.value = { problem: error instanceof Error ? error.message : String(error) };
  }
}
