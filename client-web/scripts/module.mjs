// Builds generated/page.wasm, what this page has in common with the server, from wasm/ and the rooms that it is made of.
// TELECLAY_PAGE_MODULE names one that is built already: an image for Node.js has no Rust.

import { spawnSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync } from "node:fs";
import process from "node:process";
import { fileURLToPath, URL } from "node:url";

const folder = new URL("../", import.meta.url);
const to = new URL("generated/page.wasm", folder);

const built = process.env.TELECLAY_PAGE_MODULE ?? build();
mkdirSync(new URL("./", to), { recursive: true });
if (!existsSync(to) || !readFileSync(to).equals(readFileSync(built))) copyFileSync(built, to);

/** Where cargo put the module. */
function build() {
  const arguments_ = [
    "rustc", "--release", "--locked", "--target", "wasm32-unknown-unknown", "--package", "teleclay-page", "--lib",
    "--crate-type", "cdylib", "--message-format", "json-render-diagnostics",
    // Names and line tables are twenty times the code.
    "--", "-C", "strip=symbols",
  ];
  const { error, status, stdout } = spawnSync(process.env.CARGO ?? "cargo", arguments_, {
    cwd: fileURLToPath(folder), encoding: "utf8", maxBuffer: 1 << 28, stdio: ["ignore", "pipe", "inherit"],
  });
  if (error !== undefined) throw new Error(`cargo cannot be started, and the page's module is built with it: ${error.message}`);
  if (status !== 0) {
    throw new Error("cargo could not build the page's module; where the target is missing: rustup target add wasm32-unknown-unknown");
  }
  const files = stdout.split("\n").filter((line) => line !== "").flatMap((line) => JSON.parse(line).filenames ?? []);
  const module = files.find((name) => name.endsWith("teleclay_page.wasm"));
  if (module === undefined) throw new Error("cargo built the page's module and named no teleclay_page.wasm");
  return module;
}
