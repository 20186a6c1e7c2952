// Hands out stretches of one long buffer. Lengths are rounded up to a short list of sizes, and a stretch given back is
// used again for its own size: bricks change their mesh all the time, and nothing is ever moved.

const SMALLEST = 32;

export class Ranges {
  readonly #free = new Map<number, number[]>();
  #end = 0;

  /** Everything handed out so far lies below this. */
  get end(): number {
    return this.#end;
  }

  take(length: number): number {
    const size = rounded(length);
    const again = this.#free.get(size)?.pop();
    if (again !== undefined) return again;
    const start = this.#end;
    this.#end += size;
    return start;
  }

  giveBack(start: number, length: number): void {
    const size = rounded(length);
    const list = this.#free.get(size);
    if (list === undefined) this.#free.set(size, [start]);
    else list.push(start);
  }
}

/** The next of 32, 48, 64, 96, 128, …: at most half as much again as was asked for. */
export function rounded(length: number): number {
  let size = SMALLEST;
  while (size < length) size *= 2;
  const between = (size / 4) * 3;
  return SMALLEST < size && length <= between ? between : size;
}
