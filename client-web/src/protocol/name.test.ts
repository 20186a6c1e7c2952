import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { freeName, nameFault } from "./name";

/** What the server itself says of names. */
function serversPattern(): RegExp {
  const description = JSON.parse(readFileSync(new URL("../../openapi.json", import.meta.url), "utf8")) as {
    components: { schemas: { SessionId: { pattern: string } } };
  };
  return new RegExp(description.components.schemas.SessionId.pattern, "u");
}

describe("a session's name", () => {
  it("is one exactly where the server's own description says so", () => {
    const pattern = serversPattern();
    const everyCharacter = Array.from({ length: 0x250 }, (_, code) => String.fromCharCode(code));
    const names = [
      "", "a", "demo", "fig7", "left-hand_2", "-", "_", "a b", "Ada", "a.b", "../a", "a/b", "a\n", "é", "名", "🏺", "a\u0000",
      "x".repeat(63), "x".repeat(64), "x".repeat(65), "x".repeat(1000),
      ...everyCharacter, ...everyCharacter.map((character) => `a${character}b`),
    ];
    for (const name of names) expect(nameFault(name) === undefined, JSON.stringify(name)).toBe(pattern.test(name));
  });

  it("that is none is told why, by the whole character", () => {
    expect(["", "my clay", "Ada", "🏺", "x".repeat(65)].map(nameFault)).toEqual([
      "a name is missing",
      "“space” cannot stand in a name: a–z, 0–9, - and _ can",
      "“A” cannot stand in a name: a–z, 0–9, - and _ can",
      "“🏺” cannot stand in a name: a–z, 0–9, - and _ can",
      "65 characters are more than a name's 64",
    ]);
  });

  it("is found that is not taken, and is one even where the base is as long as can be", () => {
    expect(freeName("block", [])).toBe("block");
    expect(freeName("block", ["block", "block-2", "block-4"])).toBe("block-3");
    const long = "x".repeat(64);
    const free = freeName(long, [long]);
    expect(free).not.toBe(long);
    expect(serversPattern().test(free)).toBe(true);
  });
});
