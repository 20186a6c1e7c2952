// Prints every digest as WebAssembly works it out, in the order of DIGESTS: sixteen hexadecimal digits a line.
import { readFile } from "node:fs/promises";

const [path] = process.argv.slice(2);
if (path === undefined) {
  throw new Error("usage: node run.mjs MODULE.wasm");
}
// A pure module asks for nothing: no clock, no chance, no memory of ours.
const { instance } = await WebAssembly.instantiate(await readFile(path), {});
const { digests, digest } = instance.exports;
for (let number = 0; number < digests(); number += 1) {
  console.log(BigInt.asUintN(64, digest(number)).toString(16).padStart(16, "0"));
}
