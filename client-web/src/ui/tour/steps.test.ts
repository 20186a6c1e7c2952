import { describe, expect, it } from "vitest";
import { placeOf, STEPS, WORDS_A_MINUTE } from "./steps";

describe("the tour", () => {
  it("is read in a minute, and ends where one takes a tool", () => {
    const words = STEPS.flatMap(({ title, text }) => `${title} ${text}`.split(" "));
    expect(words.length).toBeLessThanOrEqual(WORDS_A_MINUTE);
    expect(STEPS.at(-1)?.target).toContain("operate");
  });

  it("has its card beside what it points at, and within the window, whatever the two are", () => {
    for (const [width, height] of [[1280, 800], [390, 844], [1024, 500]]) {
      for (let left = -50; left < width; left += 97) {
        for (let top = -50; top < height; top += 83) {
          for (const size of [30, 200, 700]) {
            const target = { left, top, width: size, height: size / 2 };
            const card = { width: 320, height: 140 };
            const at = placeOf(target, card, { width, height });
            expect(at.left).toBeGreaterThanOrEqual(0);
            expect(at.top).toBeGreaterThanOrEqual(0);
            expect(at.left + card.width).toBeLessThanOrEqual(width);
            expect(at.top + card.height).toBeLessThanOrEqual(height);
          }
        }
      }
    }
    // Room below: the target stays in sight.
    expect(placeOf({ left: 100, top: 60, width: 300, height: 40 }, { width: 320, height: 140 }, { width: 1280, height: 800 })).toEqual({ left: 100, top: 110 });
  });
});
