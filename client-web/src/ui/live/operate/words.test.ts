import { describe, expect, it } from "vitest";
import { fakeHandState } from "../../../state/fake_hand";
import type { Hand } from "../../../state/operating";
import { linesOf, saidOf, stopWords } from "./words";

const IN = { name: "in", tool: 1, node: "lab", lease_s: 10 } as const;
const hand = (state: Partial<Hand["state"]> = {}, change: Partial<Hand> = {}): Hand => ({
  state: fakeHandState(state), pace: { how: "timers", most_ticks: 4, unsent: 0 }, rate_hz: 1000, isGuarded: false, isUnsent: false, ...change,
});
const keys = (...args: Parameters<typeof linesOf>): string[] => linesOf(...args).map(({ key }) => key);

describe("what an operator is told", () => {
  it("is nothing while all is well, and nothing while no tool is held", () => {
    expect(linesOf(IN, hand(), undefined)).toEqual([]);
    expect(linesOf({ name: "out", because: undefined }, hand({ link: "silent" }), undefined)).toEqual([]);
  });

  it("is each reason why nothing moves or little is felt", () => {
    const states: [Partial<Hand["state"]>, string[]][] = [
      [{ link: "not_yet" }, ["not-yet"]], [{ link: "silent", silence_s: 0.4 }, ["silent"]], [{ link: "on_stale_copy", copy: "stale" }, ["stale"]],
      [{ link: "gone" }, ["gone"]], [{ link: "paused" }, ["paused"]], [{ link: "fault", mode: "braking" }, ["fault"]], [{ mode: "resting" }, ["rest"]],
      [{ copy: "diverged" }, ["diverged"]], [{ grasp: "waiting" }, ["waiting"]], [{ link: "on_copy" }, []],
    ];
    for (const [state, wanted] of states) expect(keys(IN, hand(state), undefined)).toEqual(wanted);
    expect(keys(IN, hand({}, { isGuarded: true, isUnsent: true }), undefined)).toEqual(["guarded", "unsent"]);
  });

  it("is why the hand was let go of, and that it has to take hold anew", () => {
    for (const letGo of [{ kind: "limit", felt_n: 2.53 }, { kind: "hidden" }, { kind: "gap" }, { kind: "lease" }, { kind: "anew" }] as const) {
      const [line] = linesOf(IN, hand(), letGo);
      expect(line.key).toBe(`let-go-${letGo.kind}`);
      expect(line.says).toMatch(/Take hold anew to go on\.$/);
    }
    expect(linesOf(IN, hand(), { kind: "limit", felt_n: 2.53 })[0].says).toContain("2.5 N");
  });

  it("is by whom a tool is held or was taken away, and why", () => {
    expect(saidOf({ kind: "refused", code: "reserved", reason: "the tool is kept", holder: "Bob" }).says).toBe("The server gives no tool: the tool is kept. (Bob)");
    expect(saidOf({ kind: "refused", code: "reserved", reason: "kept for Bob", holder: "Bob" }).says).toBe("The server gives no tool: kept for Bob.");
    expect(saidOf({ kind: "farewell", reason: "stopped by Bob" }).says).toContain("stopped by Bob.");
    expect(stopWords({ by: "Bob", reason: "a cable" })).toBe("Bob has stopped the session: a cable.");
    expect(stopWords({ by: "the server", reason: "" })).toBe("The server has stopped the session.");
    expect(stopWords({ by: "", reason: "" })).toBe("Somebody has stopped the session.");
  });
});
