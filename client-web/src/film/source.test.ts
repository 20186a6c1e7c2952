import { describe, expect, it } from "vitest";
import { BLOCK, Source } from "./source";

/** A file whose every byte is known, and how much of it was read. */
class FakeFile {
  asked: number[] = [];
  size: number;

  constructor(size: number) {
    this.size = size;
  }

  readonly read = (offset: number, length: number): Promise<{ bytes: Uint8Array; size: number }> => {
    this.asked.push(offset / BLOCK);
    const end = Math.min(offset + length, this.size);
    const bytes = Uint8Array.from({ length: Math.max(end - offset, 0) }, (_, n) => byteAt(offset + n));
    return Promise.resolve({ bytes, size: this.size });
  };
}

const byteAt = (n: number): number => (n * 31 + Math.floor(n / 251)) % 256;

describe("a source", () => {
  it("gives the bytes that the file has, across blocks", async () => {
    const file = new FakeFile(2 * BLOCK + 500);
    const source = new Source(file.read);
    for (const [offset, length] of [[0, 10], [BLOCK - 3, 7], [BLOCK - 1, BLOCK + 2], [2 * BLOCK + 490, 10]]) {
      const bytes = await source.exactly(offset, length);
      expect(bytes.length).toBe(length);
      expect([bytes[0], bytes[length - 1]]).toEqual([byteAt(offset), byteAt(offset + length - 1)]);
    }
    expect(file.asked).toEqual([0, 1, 2]);
    expect(source.size).toBe(file.size);
    await expect(source.exactly(2 * BLOCK + 490, 11)).rejects.toThrow("the file ends at byte");
    expect((await source.from(file.size)).length).toBe(0);
  });

  it("sees that the file has grown", async () => {
    const file = new FakeFile(100);
    const source = new Source(file.read);
    expect((await source.from(0)).length).toBe(100);
    expect((await source.from(100)).length).toBe(0);
    file.size = 130;
    expect((await source.from(100)).length).toBe(30);
  });

  it("keeps no more than its bound, and what was used last", async () => {
    const file = new FakeFile(0);
    const source = new Source((offset) => {
      file.asked.push(offset / BLOCK);
      return Promise.resolve({ bytes: new Uint8Array(BLOCK), size: 200 * BLOCK });
    });
    for (let n = 0; n < 100; n += 1) {
      await source.from(n * BLOCK);
      await source.from(0);
    }
    expect(source.kept).toBe(64);
    expect(file.asked).toHaveLength(100);
  });
});
