import { describe, expect, it } from "vitest";
import { FIRST_WINDOW, following, held, LEAST_SPAN_S, MOST_SPAN_S, panned, stretchOf, zoomed } from "./plot_window";

const REACH = { oldest_s: 100, now_s: 400 };

describe("the window of the plots", () => {
  it("follows now until it is held, and again when it goes on", () => {
    expect(stretchOf(FIRST_WINDOW, REACH)).toEqual({ from_s: 390, to_s: 400 });
    const paused = held(FIRST_WINDOW, REACH);
    const later = { ...REACH, now_s: 420 };
    expect(stretchOf(paused, later)).toEqual({ from_s: 390, to_s: 400 });
    expect(stretchOf(following(paused), later)).toEqual({ from_s: 410, to_s: 420 });
  });

  it("zooms about the moment under the mouse where it is held, and about now where it is not", () => {
    const zoomedIn = zoomed({ span_s: 20, held_s: 300 }, 0.25, 0.3, REACH);
    const { from_s, to_s } = stretchOf(zoomedIn, REACH);
    expect(to_s - from_s).toBeCloseTo(5);
    expect(from_s + 0.3 * 5).toBeCloseTo(280 + 0.3 * 20);
    expect(stretchOf(zoomed(FIRST_WINDOW, 3, 0.1, REACH), REACH)).toEqual({ from_s: 370, to_s: 400 });
  });

  it("zooms no further than there is something to see", () => {
    let window = held(FIRST_WINDOW, REACH);
    for (let n = 0; n < 50; n += 1) window = zoomed(window, 0.5, 0.5, REACH);
    expect(window.span_s).toBe(LEAST_SPAN_S);
    for (let n = 0; n < 50; n += 1) window = zoomed(window, 2, 0.5, REACH);
    expect(window.span_s).toBe(MOST_SPAN_S);
    expect(stretchOf(window, REACH)).toEqual({ from_s: 100, to_s: 400 });
  });

  it("is held by a look back, goes no further back than what is kept, and follows again at now", () => {
    const back = panned(FIRST_WINDOW, -50, REACH);
    expect(stretchOf(back, REACH)).toEqual({ from_s: 340, to_s: 350 });
    expect(stretchOf(panned(back, -1000, REACH), REACH)).toEqual({ from_s: 100, to_s: 110 });
    expect(panned(back, 20, REACH).held_s).toBe(370);
    expect(panned(back, 60, REACH).held_s).toBeUndefined();
    expect(panned(FIRST_WINDOW, 5, REACH).held_s).toBeUndefined();
  });

  it("stands still while it is held, however short the session is, and moves on with what is kept", () => {
    const paused = held(FIRST_WINDOW, { oldest_s: 0, now_s: 3 });
    for (const now_s of [3, 8, 30, 290]) expect(stretchOf(paused, { oldest_s: 0, now_s })).toEqual({ from_s: -7, to_s: 3 });
    expect(stretchOf(paused, { oldest_s: 20, now_s: 320 })).toEqual({ from_s: 20, to_s: 30 });
    expect(panned(paused, 1, { oldest_s: 0, now_s: 8 }).held_s).toBe(4);
    expect(panned(paused, -1, { oldest_s: 0, now_s: 8 }).held_s).toBe(3);
  });
});
