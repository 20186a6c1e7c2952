import { describe, expect, it } from "vitest";
import { outOfRangeIn } from "../../protocol/problem";
import { problemIn, refusalIn, refusalOf } from "./refusal";

const MS = { unit: "ms", factor: 1e3 };
const problem = (pointer: string | undefined, detail: string) => ({
  type: "/problems/field", title: "a field is not acceptable", status: 422, detail, ...(pointer === undefined ? {} : { pointer }),
});

describe("a refusal of the server's", () => {
  it("has its range read, however the numbers are written", () => {
    expect(outOfRangeIn("3 is not a number from 0 to 2")).toEqual({ got: 3, least: 0, greatest: 2 });
    expect(outOfRangeIn("-1e300 is not a number from 1e-7 to 0.1")).toEqual({ got: -1e300, least: 1e-7, greatest: 0.1 });
    for (const other of ["", "2.5 came, wanted a number", "x is not a number from 0 to 2", "3 is not a number from 0 to 2, nor 7"]) {
      expect(outOfRangeIn(other)).toBeUndefined();
    }
  });

  it("is told in the unit of its field, or the one that was typed", () => {
    expect(refusalIn(MS, refusalOf("3 is not a number from 0 to 2"))).toBe("3000 ms is not from 0 to 2000 ms");
    expect(refusalIn({ unit: "s", factor: 1 }, refusalOf("3 is not a number from 0 to 2"))).toBe("3 s is not from 0 to 2 s");
    expect(refusalIn(MS, refusalOf("the server did not answer"))).toBe("the server did not answer");
  });

  it("names its field as people see it", () => {
    const fields = { "/edges_m": { label: "edges", unit: "cm", factor: 100 }, "/hand_force_n": { label: "force f_h", unit: "N", factor: 1 } };
    expect(problemIn(fields, problem("/edges_m/2", "20 is not a number from -10 to 10"))).toBe("edges: 2000 cm is not from −1000 to 1000 cm");
    expect(problemIn(fields, problem("/hand_force_n", "200 is not a number from 0.001 to 100"))).toBe("force f_h: 200 N is not from 0.001 to 100 N");
    expect(problemIn(fields, problem("/edges_m_too", "no"))).toBe("/edges_m_too: no");
    expect(problemIn(fields, problem("", "missing field `edges_m`"))).toBe("missing field `edges_m`");
    expect(problemIn(fields, problem(undefined, "the clay is too hard"))).toBe("the clay is too hard");
  });
});
