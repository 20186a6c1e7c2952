import * as THREE from "three";
import { describe, expect, it } from "vitest";
import { SmoothGround } from "./ground";

describe("the smooth ground", () => {
  it("can be drawn before it is told its colours: one that is none ends the drawing of the whole page", () => {
    const ground = new SmoothGround();
    const { uniforms } = ground.object.material;
    expect(Object.values(uniforms).every(({ value }) => value instanceof THREE.Color)).toBe(true);
    ground.colour({ background: "#102030", ground: "#405060", line: "#708090", text: "#000000" });
    expect(uniforms["line"].value).toEqual(new THREE.Color("#708090"));
    ground.dispose();
  });
});
