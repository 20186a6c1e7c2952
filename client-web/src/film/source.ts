// A file of which parts are read, wherever it lies. What was read of late is kept, so that a hand on the time line does
// not have the same bytes sent again.

/** A stretch of a file: bytes from an offset on, as many as there are, and how long the file is by now. */
export interface Part {
  readonly bytes: Uint8Array;
  readonly size: number;
}

/** Reads at most `length` bytes from `offset` on. Throws in words what cannot be read. */
export type ReadPart = (offset: number, length: number) => Promise<Part>;

/** What is read at once. */
export const BLOCK = 1 << 20;
/** Blocks that are kept: 64 MiB, a minute of two tools. */
const KEPT = 64;

export class Source {
  readonly #read: ReadPart;
  /** By number, the one that was used last at the end. */
  readonly #blocks = new Map<number, Uint8Array>();
  #size: number | undefined;

  constructor(read: ReadPart) {
    this.#read = read;
  }

  /** How long the file is, as it was told last; nothing before the first block. */
  get size(): number | undefined {
    return this.#size;
  }

  /** How many blocks are in memory. */
  get kept(): number {
    return this.#blocks.size;
  }

  /** The bytes from `offset` to the end of their block, or of the file as it is now; empty at its end. */
  async from(offset: number): Promise<Uint8Array> {
    const number = Math.floor(offset / BLOCK);
    const block = await this.#block(number, offset - number * BLOCK + 1);
    return block.subarray(offset - number * BLOCK);
  }

  /** `length` bytes from `offset` on. Throws where the file has fewer. */
  async exactly(offset: number, length: number): Promise<Uint8Array> {
    const bytes = new Uint8Array(length);
    let filled = 0;
    while (filled < length) {
      const part = await this.from(offset + filled);
      if (part.length === 0) throw new Error(`the file ends at byte ${offset + filled}, and ${offset + length} were there before`);
      const taken = part.subarray(0, length - filled);
      bytes.set(taken, filled);
      filled += taken.length;
    }
    return bytes;
  }

  /** A block with `least` bytes or more, if the file has them by now. */
  async #block(number: number, least: number): Promise<Uint8Array> {
    const kept = this.#blocks.get(number);
    if (kept !== undefined && least <= kept.length) {
      this.#blocks.delete(number);
      this.#blocks.set(number, kept);
      return kept;
    }
    const { bytes, size } = await this.#read(number * BLOCK, BLOCK);
    this.#size = size;
    this.#blocks.delete(number);
    this.#blocks.set(number, bytes);
    for (const oldest of this.#blocks.keys()) {
      if (this.#blocks.size <= KEPT) break;
      this.#blocks.delete(oldest);
    }
    return bytes;
  }
}
