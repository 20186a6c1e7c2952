// The module of WebAssembly on the page's own thread: the mathematics of the Stability and the Robot page.

import { computed, signal } from "@preact/signals";
import address from "../../generated/page.wasm?url";
import { moduleFrom, type PageModule } from "../protocol/module";

const loaded = signal<{ readonly module?: PageModule; readonly problem?: string }>({});

/** Nothing while it is on its way, and where it does not come. */
export const mathematics = computed((): PageModule | undefined => loaded.value.module);

/** Why it did not come, as a sentence. */
export const mathematicsMissing = computed((): string | undefined => {
  const { problem } = loaded.value;
  return problem === undefined ? undefined : `This page cannot calculate, as its module did not load: ${problem}. Load the page again.`;
});

export async function loadMathematics(): Promise<void> {
  try {
    loaded.value = { module: await moduleFrom(fetch(address)) };
  } catch (error) {
    loaded.value = { problem: error instanceof Error ? error.message : String(error) };
  }
}
