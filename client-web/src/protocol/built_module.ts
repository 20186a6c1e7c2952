// Modules as a test has them: out of the files that `npm run module` made.

import { readFileSync } from "node:fs";
import { MathematicsModule } from "./mathematics";
import { PageModule } from "./module";

export async function builtModule(): Promise<PageModule> {
  return new PageModule(await instanceOf("page"));
}

export async function builtMathematics(): Promise<MathematicsModule> {
  return new MathematicsModule(await instanceOf("mathematics"));
}

async function instanceOf(name: string): Promise<WebAssembly.Instance> {
  const file = readFileSync(`${import.meta.dirname}/../../generated/${name}.wasm`);
  return (await WebAssembly.instantiate(file, {})).instance;
}
