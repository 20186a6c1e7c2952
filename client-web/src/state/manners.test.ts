import { describe, expect, it } from "vitest";
import type { Session, ToolState } from "../protocol/session";
import { fakeSession } from "./fake_session";
import { hindrance, toolRows } from "./manners";

const [A_TOOL] = fakeSession().tools;
const FREE: Partial<ToolState> = { operator: "", connected: false };

function session(state: Session["state"], ...tools: Partial<ToolState>[]): Session {
  return fakeSession({ state, tools: tools.map((tool, n) => ({ ...A_TOOL, id: n + 1, ...tool })) });
}

const BOB = { name: "Bob", tool: undefined };

describe("who may do what", () => {
  it("a tool that another holds can be asked for, once, by one who holds none", () => {
    const held = session("running", { requests: ["Cy"] });
    expect(toolRows(held, BOB)).toEqual([
      { id: 1, holding: { name: "held", operator: "Ada", isSilent: false }, requests: ["Cy"], request: "may", answers: false },
    ]);
    expect(toolRows(session("running", { requests: ["Cy", "Bob"] }), BOB)[0].request).toBe("asked");
    expect(toolRows(session("running", {}, {}), { name: "Bob", tool: 2 })[0].request).toBe("no");
    expect(toolRows(session("stopped", {}), BOB)[0].request).toBe("no");
  });

  it("who holds it answers those who ask; nobody else does", () => {
    const asked = session("running", { requests: ["Bob", "Cy"] }, { operator: "Dee", requests: ["Eve"] });
    expect(toolRows(asked, { name: "Ada", tool: 1 }).map(({ answers }) => answers)).toEqual([true, false]);
    // Another page of the same name holds nothing.
    expect(toolRows(asked, { name: "Ada", tool: undefined }).map(({ answers }) => answers)).toEqual([false, false]);
  });

  it("one that was handed over is kept for whom it is", () => {
    const kept = session("running", { ...FREE, reserved_for: "Bob" });
    expect(toolRows(kept, BOB)[0].holding).toEqual({ name: "kept", operator: "Bob", isForMe: true });
    expect(toolRows(kept, { name: "Cy", tool: undefined })[0].holding).toMatchObject({ isForMe: false });
  });

  it("a tool can be had that is free, kept for me, or held by one who is silent; and none while the session is stopped", () => {
    const can = (state: Session["state"], tool: Partial<ToolState>): boolean => {
      const at = session(state, {}, tool);
      return hindrance(at, toolRows(at, BOB)) === undefined;
    };
    expect(can("running", FREE)).toBe(true);
    expect(can("idle", { connected: false })).toBe(true);
    expect(can("running", { ...FREE, reserved_for: "Bob" })).toBe(true);
    expect(can("running", { ...FREE, reserved_for: "Cy" })).toBe(false);
    expect(can("running", {})).toBe(false);
    expect(can("stopped", FREE)).toBe(false);
  });
});
