import { describe, expect, it } from "vitest";
import { FakePlatform, settled } from "./fake_platform";
import { Past } from "./past";
import type { Loaded } from "./platform";

const encoded = (text: string): ArrayBuffer => new TextEncoder().encode(text).buffer;
const served = (text: string, status = 200): Loaded => ({ status, bytes: encoded(text) });

function looking(): { platform: FakePlatform; past: Past<string> } {
  const platform = new FakePlatform();
  const past = new Past(platform, (at_s) => `clay?at_s=${at_s}`, (bytes) => {
    const text = new TextDecoder().decode(bytes);
    return text === "nonsense" ? Promise.reject(new Error("no clay")) : Promise.resolve(text);
  });
  return { platform, past };
}

/** Files that come when the test says so. */
function held(platform: FakePlatform): ((text: string) => void)[] {
  const waiting: ((text: string) => void)[] = [];
  platform.file = () => new Promise((resolve) => waiting.push((text) => resolve(served(text))));
  return waiting;
}

describe("the past", () => {
  it("is asked for once for many moves of a hand, at the last of them", async () => {
    const { platform, past } = looking();
    platform.file = (path) => served(path);
    for (const at_s of [1, 2, 3]) past.show(at_s);
    expect(past.moment.value).toEqual({ name: "asked", at_s: 3 });
    await platform.pass(200);
    expect(platform.loads.map(({ path }) => path)).toEqual(["clay?at_s=3"]);
    expect(past.moment.value).toEqual({ name: "shown", at_s: 3 });
    expect(past.clay.value).toBe("clay?at_s=3");
  });

  it("is answered now and then while a hand moves on and on", async () => {
    const { platform, past } = looking();
    platform.file = (path) => served(path);
    for (let n = 0; n < 100; n += 1) {
      past.show(n);
      await platform.pass(16);
    }
    const asked = platform.loads.length;
    // 1.6 s at one in 150 ms.
    expect(asked).toBeGreaterThan(7);
    expect(asked).toBeLessThan(12);
  });

  it("gives up what is overtaken, and an answer that comes all the same is not shown", async () => {
    const { platform, past } = looking();
    const waiting = held(platform);
    past.show(1);
    await platform.pass(200);
    past.show(2);
    await platform.pass(200);
    expect(platform.loads.map(({ signal }) => signal.aborted)).toEqual([true, false]);
    waiting[1]("two");
    await settled();
    waiting[0]("one");
    await settled();
    expect(past.clay.value).toBe("two");
    expect(past.moment.value).toEqual({ name: "shown", at_s: 2 });
  });

  it("is over at once when somebody goes back to now, whatever is still to come", async () => {
    const { platform, past } = looking();
    const waiting = held(platform);
    past.show(1);
    await platform.pass(200);
    past.backToNow();
    expect(platform.loads[0].signal.aborted).toBe(true);
    waiting[0]("one");
    await platform.pass(1000);
    expect([past.moment.value, past.clay.value]).toEqual([{ name: "now" }, undefined]);
    past.show(5);
    past.backToNow();
    await platform.pass(1000);
    expect(platform.loads).toHaveLength(1);
    past.show(6);
    await platform.pass(200);
    expect(platform.loads[1].path).toBe("clay?at_s=6");
  });

  it("is asked for again where a server is busy, for a while, and not once somebody looks elsewhere", async () => {
    const { platform, past } = looking();
    const busy = { type: "/problems/busy", title: "busy", status: 503, detail: "enough is under way" };
    let left = 3;
    platform.file = () => {
      left -= 1;
      return left < 0 ? served("clay") : served(JSON.stringify(busy), 503);
    };
    past.show(1);
    await platform.pass(3000);
    expect([past.moment.value, platform.loads.length]).toEqual([{ name: "shown", at_s: 1 }, 4]);
    left = 1000;
    past.show(2);
    await platform.pass(10_000);
    expect(past.moment.value).toEqual({ name: "refused", at_s: 2, because: "enough is under way" });
    const asked = platform.loads.length;
    past.show(3);
    await platform.pass(500);
    past.backToNow();
    await platform.pass(10_000);
    expect(platform.loads.length - asked).toBeLessThan(3);
  });

  it("that cannot be had says why, and shows no other moment instead", async () => {
    const { platform, past } = looking();
    platform.file = () => served("clay");
    past.show(1);
    await platform.pass(200);
    const problem = { type: "/problems/not-kept", title: "not kept", status: 409, detail: "that lies before everything that is kept" };
    platform.file = () => served(JSON.stringify(problem), 409);
    past.show(2);
    await platform.pass(200);
    expect(past.moment.value).toEqual({ name: "refused", at_s: 2, because: "that lies before everything that is kept" });
    expect(past.clay.value).toBeUndefined();
    platform.file = () => {
      throw new Error("nobody answers");
    };
    past.show(3);
    await platform.pass(200);
    expect(past.moment.value).toMatchObject({ name: "refused", because: "the server did not answer" });
    platform.file = () => served("nonsense");
    past.show(4);
    await platform.pass(200);
    expect(past.moment.value).toMatchObject({ name: "refused", because: "the answer is not understood: no clay" });
  });
});
