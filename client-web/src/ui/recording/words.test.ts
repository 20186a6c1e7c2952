import { describe, expect, it } from "vitest";
import type { FilmFacts, FilmMoment } from "../../protocol/film";
import { remarkOf, remarksOf } from "./words";

const whole: FilmFacts = {
  session: "demo", lasts_s: 10, ticks: 10_000, dropped: 0, bytes: 1, hashes: 10, hash: "0123456789abcdef", differs_s: null,
  end: "whole", reason: null, tools: [true], marks: [], gaps: [], column_s: 0.002, keyframe_s: 4, keyframe_bytes: 1,
};
const read = { isRead: true, goesOn: false };
const moment: FilmMoment = { at_s: 1, tick: 1, is_full: false, clay: { hash: "0", remaining_units: 1 }, lost: null, tools: [], settings: null };

describe("what is said of a recording", () => {
  it("is nothing of one that is whole", () => {
    expect(remarksOf(whole, read)).toEqual([]);
    expect(remarkOf(moment)).toBeUndefined();
  });

  it("tells one that goes on from one that was cut off", () => {
    expect(remarksOf({ ...whole, end: "ahead" }, { isRead: true, goesOn: true })[0].text).toContain("still goes on");
    expect(remarksOf({ ...whole, end: "cut_off" }, read)[0].text).toContain("cut off");
    // Nobody knows before it is read.
    expect(remarksOf({ ...whole, end: "ahead" }, { isRead: false, goesOn: false })).toEqual([]);
  });

  it("names what is missing, and why", () => {
    const gaps = [{ from_s: 1.5, to_s: 2, why: { kind: "dropped", ticks: 300 } }, { from_s: 3, to_s: null, why: { kind: "elsewhere" } }] as const;
    const texts = remarksOf({ ...whole, dropped: 300, gaps }, read).map(({ text }) => text);
    expect(texts).toHaveLength(3);
    expect(texts[0]).toContain("300 ticks");
    expect(texts[1]).toContain("From 1.500 s to 2.000 s");
    expect(texts[2]).toMatch(/From 3\.000 s on .* undone/);
    expect(remarksOf({ ...whole, gaps: Array.from({ length: 9 }, () => gaps[0]) }, read).at(-1)?.text).toContain("6 more");
  });

  it("puts a clay that does not come out before all else", () => {
    expect(remarksOf({ ...whole, differs_s: 4, dropped: 3 }, read)[0]).toMatchObject({ level: "error" });
  });

  it("says of a moment why its clay is an older one", () => {
    expect(remarkOf({ ...moment, clay: null })?.text).toContain("not there yet");
    expect(remarkOf({ ...moment, clay: null, lost: { kind: "missing", ticks: 7 } })?.text).toContain("7 ticks");
    expect(remarkOf({ ...moment, is_full: true })?.text).toContain("rested");
  });
});
