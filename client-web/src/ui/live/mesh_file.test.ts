import { describe, expect, it } from "vitest";
import { meshRefusal, meshTypeOf } from "./mesh_file";

describe("a file for clay", () => {
  it("is known by its name's end, whatever its case", () => {
    expect(["cup.stl", "CUP.STL", "a.b.3mf", "cup.obj", "stl", "cup.stl.zip"].map(meshTypeOf)).toEqual(
      ["model/stl", "model/stl", "model/3mf", undefined, undefined, undefined]);
  });

  it("that is refused is told of in the server's words, with what helps", () => {
    const problem = { type: "/problems/mesh_open", title: "the mesh is open", status: 422, detail: "the mesh has 12 open edges" };
    expect(meshRefusal("cup.stl", problem)).toBe(
      "cup.stl: the mesh has 12 open edges. Clay has an inside: close the surface in a modelling program first.");
    expect(meshRefusal("cup.stl", { ...problem, type: "/problems/busy", detail: "try later" })).toBe("cup.stl: try later.");
  });
});
