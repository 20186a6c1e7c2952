import { describe, expect, it } from "vitest";
import { pointsOf, stretchAbout } from "./curve";

const term = { channel: 0, factor: 1000, offset: 5 };
const plot = { tool: 1, channels: [0], from_s: 10, to_s: 14, columns: 4 };
const NONE = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];

describe("points of a curve", () => {
  it("are the least and the greatest of each column, where the column stands", () => {
    const points = pointsOf([term], plot, [Float32Array.from([1, 2, 3, 4, -1, -1, 0, 8])]);
    expect(points.count).toBe(8);
    expect([...points.time_s]).toEqual([10.25, 10.75, 11.25, 11.75, 12.25, 12.75, 13.25, 13.75]);
    expect([...points.curves[0]]).toEqual([1005, 2005, 3005, 4005, -995, -995, 5, 8005]);
    expect([points.least, points.greatest]).toEqual([-995, 8005]);
  });

  it("break where nothing was told for long, and go on over what is only seldom", () => {
    const told = [1, 2];
    const columns = 20;
    const at = (n: number): number[] => (n === 0 || n === 2 || n === 15 ? told : NONE);
    const points = pointsOf([term], { ...plot, columns, to_s: 10 + columns }, [Float32Array.from(Array.from({ length: columns }, (_, n) => at(n)).flat())]);
    const gaps = [...points.curves[0].subarray(0, points.count)].map((value) => Number.isNaN(value));
    expect(gaps).toEqual([false, false, false, false, true, false, false, true]);
  });
});

describe("a stretch about a moment", () => {
  it("lies within the recording, with the moment in its middle where that can be", () => {
    expect(stretchAbout(5, 100, 10)).toEqual({ from_s: 0, to_s: 10 });
    expect(stretchAbout(5, 2, 10)).toEqual({ from_s: 4, to_s: 6 });
    expect(stretchAbout(0, 2, 10)).toEqual({ from_s: 0, to_s: 2 });
    expect(stretchAbout(10, 2, 10)).toEqual({ from_s: 8, to_s: 10 });
  });
});
