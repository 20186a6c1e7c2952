// Builds what this page has in common with the server, with the rooms that it is made of: generated/page.wasm, the clay
// on show, from wasm/; generated/mathematics.wasm, that of Stability and Robot, from mathematics/; generated/hand.wasm,
// the hand of its worker, from hand/; generated/film.wasm, which reads recordings, from film/. TELECLAY_PAGE_MODULE,
// TELECLAY_MATHEMATICS_MODULE, TELECLAY_HAND_MODULE and TELECLAY_FILM_MODULE name ones that are built already: an image
// for Node.js has no Rust.

import { spawnSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync } from "node:fs";
import process from "node:process";
import { fileURLToPath, URL } from "node:url";

const folder = new URL("../", import.meta.url);

for (const name of ["page", "mathematics", "hand", "film"]) {
  const to = new URL(`generated/${name}.wasm`, folder);
  const built = process.env[`TELECLAY_${name.toUpperCase()}_MODULE`] ?? build(name);
  mkdirSync(new URL("./", to), { recursive: true });
  if (!existsSync(to) || !readFileSync(to).equals(readFileSync(built))) copyFileSync(built, to);
}

/** Where cargo put a module. */
function build(name) {
  const arguments_ = [
    "rustc", "--profile", "page", "--locked", "--target", "wasm32-unknown-unknown", "--package", `teleclay-${name}`, "--lib",
    "--crate-type", "cdylib", "--message-format", "json-render-diagnostics",
  ];
  const { error, status, stdout } = spawnSync(process.env.CARGO ?? "cargo", arguments_, {
    cwd: fileURLToPath(folder), encoding: "utf8", maxBuffer: 1 << 28, stdio: ["ignore", "pipe", "inherit"],
  });
  if (error !== undefined) throw new Error(`cargo cannot be started, and the module ${name} is built with it: ${error.message}`);
  if (status !== 0) {
    throw new Error(`cargo could not build the module ${name}; where the target is missing: rustup target add wasm32-unknown-unknown`);
  }
  const files = stdout.split("\n").filter((line) => line !== "").flatMap((line) => JSON.parse(line).filenames ?? []);
  const module = files.find((file) => file.endsWith(`teleclay_${name}.wasm`));
  if (module === undefined) throw new Error(`cargo built the module ${name} and named no teleclay_${name}.wasm`);
  return module;
}
