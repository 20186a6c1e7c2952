// The module as a test has it: out of the file that `npm run module` made.

import { readFileSync } from "node:fs";
import { PageModule } from "./module";

export async function builtModule(): Promise<PageModule> {
  const file = readFileSync(`${import.meta.dirname}/../../generated/page.wasm`);
  return new PageModule((await WebAssembly.instantiate(file, {})).instance);
}
