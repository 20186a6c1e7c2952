import { describe, expect, it } from "vitest";
import { Asking } from "./asking";
import { fakeSession } from "./fake_session";
import { toolRows, type ToolRow } from "./manners";

const [TOOL] = fakeSession().tools;
const rows = (change: Partial<typeof TOOL>): ToolRow[] =>
  toolRows(fakeSession({ tools: [{ ...TOOL, ...change }] }), { name: "Bob", tool: undefined });

describe("a request", () => {
  const asked = rows({ requests: ["Bob"] });
  const ends: [string, ToolRow[], string][] = [
    ["is given", rows({ operator: "", connected: false, reserved_for: "Bob" }), "given"],
    ["goes to another", rows({ operator: "", connected: false, reserved_for: "Cy" }), "gone"],
    ["has nobody to answer it", rows({ operator: "", connected: false }), "gone"],
    ["is denied, or runs out", rows({}), "ended"],
  ];
  it.each(ends)("%s, and that is told once", (_, now, end) => {
    const asking = new Asking();
    asking.ask(1);
    // The state may be from before the request.
    expect(asking.look(rows({}))).toBeUndefined();
    expect(asking.look(rows({ operator: "", connected: false }))).toBeUndefined();
    expect(asking.look(asked)).toBeUndefined();
    expect(asking.look(asked)).toBeUndefined();
    expect(asking.look(now)).toBe(end);
    expect(asking.look(now)).toBeUndefined();
  });

  it("that nobody made ends in nothing", () => {
    const asking = new Asking();
    expect(asking.look(rows({ operator: "", connected: false, reserved_for: "Bob" }))).toBeUndefined();
    asking.ask(1);
    asking.forget();
    expect(asking.look(rows({ operator: "", connected: false, reserved_for: "Bob" }))).toBeUndefined();
  });
});
