import { describe, expect, it } from "vitest";
import { builtHand, recordedStroke } from "./built_hand";
import { DecodeError } from "./header";
import { decodeHandAnswer, encodeHandQuestion } from "./operate";

describe("the texts of the hand's socket", () => {
  it("carry a grant through to the module as the server wrote it", async () => {
    const { keys, granted } = recordedStroke();
    const answer = decodeHandAnswer(`{"type":"granted","keys":"${keys}","granted":${granted}}`);
    expect(answer.type).toBe("granted");
    if (answer.type !== "granted") return;
    expect(answer.grant).toMatchObject({ tool: 1, node: "sim", lease_s: 10 });
    expect([...answer.grant.keys]).toEqual([...new Array<number>(32).fill(7), ...new Array<number>(32).fill(11)]);
    const module = await builtHand();
    module.begin(5, { keys: answer.grant.keys, granted: answer.grant.json }, { rate_hz: 60, motion: 1 });
    expect(module.look()?.grasp).toBe("released");
  });

  it("say who holds what was refused, where somebody does", () => {
    const refused = { type: "refused", code: "reserved", reason: "kept for Bob" };
    const without = { type: "refused", refusal: { code: "reserved", reason: "kept for Bob", holder: undefined } };
    expect(decodeHandAnswer(JSON.stringify(refused))).toEqual(without);
    expect(decodeHandAnswer(JSON.stringify({ ...refused, holder: null }))).toEqual(without);
    expect(decodeHandAnswer(JSON.stringify({ ...refused, holder: "Bob" }))).toMatchObject({ refusal: { holder: "Bob" } });
  });

  it("are passed over where this page does not know them, and refused where they are not what they say", () => {
    expect(decodeHandAnswer('{"type":"state","session":{}}')).toEqual({ type: "other" });
    expect(decodeHandAnswer('{"type":"tomorrow"}')).toEqual({ type: "other" });
    const wrong = [
      "granted", "{}", '{"type":"farewell"}', '{"type":"snapshot","clay":{"epoch":1,"revision":0},"messages":-1}',
      '{"type":"parameters","parameters":{"revision":"3"}}', '{"type":"granted","keys":"0707","granted":{}}',
    ];
    for (const text of wrong) expect(() => decodeHandAnswer(text), text).toThrow(DecodeError);
  });

  it("ask in the server's words", () => {
    const device = { name: "mouse", axes: 2, force_n: 0, rate_hz: 60, measures_force: false } as const;
    expect(encodeHandQuestion({ type: "join", operator: "Ada", device })).toBe(
      '{"type":"join","operator":"Ada","device":{"name":"mouse","axes":2,"force_n":0,"rate_hz":60,"measures_force":false}}',
    );
    expect(encodeHandQuestion({ type: "snapshot", epoch: 3 })).toBe('{"type":"snapshot","epoch":3}');
  });
});
