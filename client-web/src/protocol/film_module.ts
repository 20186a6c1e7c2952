// The module of WebAssembly that reads recordings (film/src/film.rs): its calls as checked types.

import { decodeFilmFacts, decodeFilmMoment, type FilmFacts, type FilmMoment } from "./film";
import { type Calls, callsOf, ModuleRefusal } from "./instance";

/** As `Buffer` of the module counts them. */
const Buffer = { bytesIn: 0, text: 1, numbers: 2, envelope: 3, bricks: 4 } as const;

const MORE = 1;
const REFUSED = 2;

/** Names of the module's functions, with how many numbers each takes. */
const FUNCTIONS = {
  address: 1, length: 1, resize_bytes_in: 1,
  push: 0, seek: 1, give: 0, tell_recording: 1, tell_moment: 0, find_envelope: 5, tell_clay: 0, next_bricks: 0,
} as const;

/** Bytes of the file that a moment needs. */
export interface Want {
  readonly offset: number;
  readonly length: number;
}

export class FilmModule {
  readonly #exports: Calls<keyof typeof FUNCTIONS>;

  /** Throws where the module is not the one that this page was built with. */
  constructor(instance: WebAssembly.Instance) {
    this.#exports = callsOf(instance, FUNCTIONS);
  }

  /** Memory that it takes. */
  get bytes(): number {
    return this.#exports.memory.buffer.byteLength;
  }

  /**
   * Takes in the next piece of the file; an empty one is its end. Throws {@link ModuleRefusal} where it is no
   * recording, or damaged from there on.
   */
  push(piece: Uint8Array): void {
    this.#put(piece);
    this.#carriedOut(this.#exports.push());
  }

  /** Sets out for a moment; what of the file it needs, or nothing once it is there. */
  seek(at_s: number): Want | undefined {
    return this.#want(this.#exports.seek(at_s));
  }

  /** Takes in what was wanted; what else is. */
  give(bytes: Uint8Array): Want | undefined {
    this.#put(bytes);
    return this.#want(this.#exports.give());
  }

  /** What is known so far, and what happened from a mark on, by its number from 0. */
  facts(firstMark: number): FilmFacts {
    this.#exports.tell_recording(firstMark);
    return decodeFilmFacts(this.#text());
  }

  /** The moment on show. */
  moment(): FilmMoment {
    this.#exports.tell_moment();
    return decodeFilmMoment(this.#text());
  }

  /**
   * The least and the greatest of a channel of a tool in each of the columns; the first is above the second where there
   * is nothing.
   */
  envelope(tool: number, channel: number, from_s: number, to_s: number, columns: number): Float32Array<ArrayBuffer> {
    this.#exports.find_envelope(tool, channel, from_s, to_s, columns);
    return new Float32Array(this.#exports.memory.buffer, this.#address(Buffer.envelope), this.#length(Buffer.envelope)).slice();
  }

  /** Messages of bricks that make the clay that was told last into the one on show. */
  bricks(): ArrayBuffer[] {
    this.#carriedOut(this.#exports.tell_clay());
    const messages: ArrayBuffer[] = [];
    while (this.#exports.next_bricks() === MORE) messages.push(this.#bytes(Buffer.bricks).slice().buffer);
    return messages;
  }

  #want(outcome: number): Want | undefined {
    if (this.#carriedOut(outcome) !== MORE) return undefined;
    const [offset, length] = new Float64Array(this.#exports.memory.buffer, this.#address(Buffer.numbers), 2);
    return { offset, length };
  }

  #put(bytes: Uint8Array): void {
    this.#exports.resize_bytes_in(bytes.byteLength);
    new Uint8Array(this.#exports.memory.buffer, this.#address(Buffer.bytesIn), bytes.byteLength).set(bytes);
  }

  #carriedOut(outcome: number): number {
    if (outcome === REFUSED) throw new ModuleRefusal(this.#text());
    return outcome;
  }

  #text(): string {
    return new TextDecoder().decode(this.#bytes(Buffer.text));
  }

  #bytes(buffer: number): Uint8Array<ArrayBuffer> {
    const memory = this.#exports.memory.buffer;
    return new Uint8Array(memory, this.#address(buffer), this.#length(buffer));
  }

  #address(buffer: number): number {
    return this.#exports.address(buffer) >>> 0;
  }

  #length(buffer: number): number {
    return this.#exports.length(buffer) >>> 0;
  }
}

/** The module out of a file on its way. Throws where it does not come, or the browser does not run it. */
export async function filmModuleFrom(file: Promise<Response>): Promise<FilmModule> {
  const response = await file;
  if (!response.ok) throw new Error(`${response.url} answers ${response.status}`);
  return new FilmModule((await WebAssembly.instantiateStreaming(response, {})).instance);
}
