// What all modules of WebAssembly on this page have in common. What crosses is numbers; whatever is longer is copied
// into a module's memory and out of it. That memory moves when it grows, so every buffer is asked for its place after
// the call that filled it.

/** The functions of a module, and its memory. */
export type Calls<Name extends string> = Readonly<Record<Name, (...numbers: number[]) => number>> & { readonly memory: WebAssembly.Memory };

/** What a module refused, in its own words. */
export class ModuleRefusal extends Error {
  override readonly name = "ModuleRefusal";
}

/**
 * What a module offers; `functions` names each with how many numbers it takes. Throws where the module is not the one
 * that this page was built with.
 */
export function callsOf<Name extends string>({ exports }: WebAssembly.Instance, functions: Readonly<Record<Name, number>>): Calls<Name> {
  for (const name of Object.keys(functions)) {
    if (typeof exports[name] !== "function") throw new TypeError(`the module has no function ${name}`);
  }
  if (!(exports["memory"] instanceof WebAssembly.Memory)) throw new TypeError("the module has no memory");
  return exports as unknown as Calls<Name>;
}

/** Why the last call that was refused was: what lies in the buffer of that number. */
export function refusalIn(calls: Calls<"address" | "length">, buffer: number): string {
  return new TextDecoder().decode(new Uint8Array(calls.memory.buffer, calls.address(buffer) >>> 0, calls.length(buffer) >>> 0));
}

/**
 * What a file on its way is compiled to, while it comes. Throws where it does not come, or the browser does not run it.
 */
export async function instanceFrom(file: Promise<Response>): Promise<WebAssembly.Instance> {
  const response = await file;
  if (!response.ok) throw new Error(`${response.url} answers ${response.status}`);
  return (await WebAssembly.instantiateStreaming(response, {})).instance;
}
