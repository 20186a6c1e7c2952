import { describe, expect, it } from "vitest";
import type { FilmFacts, FilmMoment } from "../protocol/film";
import type { Want } from "../protocol/film_module";
import type { FromFilm } from "./port";
import { type Hall, Projector } from "./projector";
import { BLOCK, Source } from "./source";

const facts = (bytes: number): FilmFacts => ({
  session: "demo", lasts_s: 1, ticks: 1, dropped: 0, bytes, hashes: 0, hash: null, differs_s: null, end: "ahead",
  reason: null, tools: [], marks: [], gaps: [], column_s: 0.001, keyframe_s: 4, keyframe_bytes: 0,
});
const momentAt = (at_s: number): FilmMoment => ({ at_s, tick: 0, is_full: false, clay: null, lost: null, tools: [], settings: null });

/** A module for which each moment is three chunks away. */
class FakeModule {
  readonly did: string[] = [];
  pushed = 0;
  #at_s = 0;
  #left = 0;
  brokenAt = Number.POSITIVE_INFINITY;

  push(piece: Uint8Array): void {
    this.did.push(piece.length === 0 ? "end" : "push");
    if (this.brokenAt <= this.pushed) throw new Error("the file is damaged");
    this.pushed += piece.length;
  }

  seek(at_s: number): Want | undefined {
    this.did.push(`seek ${at_s}`);
    this.#at_s = at_s;
    this.#left = 3;
    return this.#want();
  }

  give(): Want | undefined {
    this.did.push("give");
    this.#left -= 1;
    return this.#want();
  }

  #want(): Want | undefined {
    return this.#left === 0 ? undefined : { offset: 10 * this.#left, length: 10 };
  }

  readonly facts = (): FilmFacts => facts(this.pushed);
  readonly moment = (): FilmMoment => momentAt(this.#at_s);
  readonly envelope = (): Float32Array<ArrayBuffer> => new Float32Array(2);
  readonly bricks = (): ArrayBuffer[] => [new ArrayBuffer(this.#at_s)];
}

function hallOf(module: FakeModule, blocks: number): { hall: Hall; posted: FromFilm[]; breaths: (() => void)[]; file: { size: number } } {
  const posted: FromFilm[] = [];
  const breaths: (() => void)[] = [];
  const file = { size: blocks * BLOCK };
  const source = new Source((offset, length) =>
    Promise.resolve({ bytes: new Uint8Array(Math.max(Math.min(length, file.size - offset), 0)), size: file.size }));
  let now_ms = 0;
  return {
    hall: {
      module,
      source,
      post: (message) => posted.push(message),
      // Every look at the clock is a long time: whatever may breathe, does.
      now_ms: () => (now_ms += 1000),
      breathe: () => {
        breaths.shift()?.();
        return Promise.resolve();
      },
    },
    posted,
    breaths,
    file,
  };
}

describe("a projector", () => {
  it("reads to the end, and shows a moment that is wished meanwhile first", async () => {
    const module = new FakeModule();
    const { hall, posted, breaths } = hallOf(module, 3);
    const projector = new Projector(hall, false);
    breaths.push(() => projector.take({ type: "seek", at_s: 5 }));
    await projector.run();
    expect(module.did).toEqual(["push", "seek 5", "give", "give", "give", "push", "push", "end"]);
    expect(posted.flatMap((message) => (message.type === "moment" ? [message.asked_s] : []))).toEqual([5]);
    expect(posted.at(-1)).toMatchObject({ type: "facts", isRead: true, size: 3 * BLOCK });
    expect(posted.find(({ type }) => type === "bricks")).toBeDefined();
  });

  it("gives a wish up for a newer one, and tells of the newer alone", async () => {
    const module = new FakeModule();
    const { hall, posted, breaths } = hallOf(module, 1);
    const projector = new Projector(hall, false);
    breaths.push(() => undefined, () => projector.take({ type: "seek", at_s: 2 }));
    projector.take({ type: "seek", at_s: 1 });
    await projector.run();
    // The one that was under way ends; then there is nothing else to do.
    while (!posted.some((message) => message.type === "facts" && message.isRead)) await Promise.resolve();
    expect(module.did.slice(0, 3)).toEqual(["seek 1", "give", "seek 2"]);
    expect(posted.flatMap((message) => (message.type === "moment" ? [message.asked_s] : []))).toEqual([2]);
  });

  it("says what is wrong with a file, and shows what came before", async () => {
    const module = new FakeModule();
    module.brokenAt = BLOCK;
    const { hall, posted } = hallOf(module, 4);
    const projector = new Projector(hall, false);
    await projector.run();
    expect(posted.filter(({ type }) => type === "trouble")).toEqual([{ type: "trouble", says: "the file is damaged" }]);
    expect(module.did).toEqual(["push", "push"]);
    projector.take({ type: "seek", at_s: 1 });
    while (!posted.some(({ type }) => type === "moment")) await Promise.resolve();
    expect(module.did.at(-1)).toBe("give");
  });

  it("reads on where the file has grown, and ends it once it grows no more", async () => {
    const module = new FakeModule();
    const { hall, posted, file } = hallOf(module, 0);
    file.size = 100;
    const projector = new Projector(hall, true);
    await projector.run();
    expect(module.did).toEqual(["push"]);
    file.size = 250;
    projector.take({ type: "more", grows: false });
    while (module.did.at(-1) !== "end") await Promise.resolve();
    expect(module.pushed).toBe(250);
    expect(posted.at(-1)).toMatchObject({ type: "facts", isRead: true });
  });
});
