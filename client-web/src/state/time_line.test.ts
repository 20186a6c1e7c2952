import { describe, expect, it } from "vitest";
import type { Session } from "../protocol/session";
import type { Strokes } from "../protocol/strokes";
import { FakePlatform } from "./fake_platform";
import { fakeSession } from "./fake_session";
import { Live } from "./live";
import { TimeLine } from "./time_line";

const STROKES: Strokes = {
  from_s: 0, to_s: 9,
  strokes: [{ number: 1, tool: 1, operator: "Ada", from_s: 2, to_s: 4, removed_volume_m3: 1e-6, undone: false }],
};

/** The session after so many cuts and so many changes of its block. */
function cutSession(removed_units: number, epoch = 1): Session {
  const session = fakeSession();
  return { ...session, clay: { ...session.clay, removed_units, epoch } };
}

interface Watched {
  readonly platform: FakePlatform;
  readonly live: Live;
  readonly line: TimeLine;
  readonly asked: () => number;
  readonly tell: (session: Session) => void;
}

async function watched(): Promise<Watched> {
  const platform = new FakePlatform();
  platform.answer = (_method, path) => ({ status: 200, body: JSON.stringify(path.endsWith("/history") ? STROKES : [fakeSession()]) });
  const live = new Live(platform);
  live.open(undefined);
  await platform.pass(0);
  const tell = (session: Session): void => platform.lastSocket.events.onText(JSON.stringify({ type: "state", session }));
  platform.lastSocket.events.onOpen();
  tell(fakeSession());
  return {
    platform, live, line: new TimeLine(platform, live), tell,
    asked: () => platform.requests.filter(({ path }) => path === "api/v1/sessions/demo/history").length,
  };
}

/** Lets time pass, with the signs of life that keep the stream open. */
async function pass({ platform, tell }: Watched, seconds: number, session: (n: number) => Session): Promise<void> {
  for (let n = 0; n < 4 * seconds; n += 1) {
    tell(session(n));
    await platform.pass(250);
  }
}

describe("the time line", () => {
  it("is asked for every second while somebody cuts, seldom while nobody does, and never when nobody looks", async () => {
    const world = await watched();
    const end = world.line.watch();
    await pass(world, 10, (n) => cutSession(n));
    expect(world.line.strokes.value).toEqual(STROKES);
    const cutting = world.asked();
    expect(cutting).toBeGreaterThan(6);
    expect(cutting).toBeLessThan(12);
    await pass(world, 20, () => cutSession(99));
    expect(world.asked() - cutting).toBeGreaterThan(2);
    expect(world.asked() - cutting).toBeLessThan(6);
    end();
    const all = world.asked();
    await pass(world, 20, (n) => cutSession(n));
    expect(world.asked()).toBe(all);
  });

  it("is new at once after an undo, and so is the clay", async () => {
    const world = await watched();
    const end = world.line.watch();
    await pass(world, 1, () => cutSession(5));
    const undone: Strokes = { ...STROKES, strokes: [{ ...STROKES.strokes[0], undone: true }] };
    world.platform.answer = (method) => ({ status: 200, body: JSON.stringify(method === "POST" ? cutSession(0, 2) : undone) });
    expect(await world.line.undo({ tool: 1 })).toBe(true);
    expect(world.platform.requests.find(({ method }) => method === "POST")).toEqual(
      { method: "POST", path: "api/v1/sessions/demo/undo", body: { tool: 1 } });
    expect(world.line.strokes.value).toEqual(undone);
    expect(world.live.session.value?.clay).toMatchObject({ epoch: 2, removed_units: 0 });
    end();
  });

  it("says why there was nothing to undo, until something was done", async () => {
    const world = await watched();
    const detail = "there is no stroke to undo";
    world.platform.answer = () => ({ status: 409, body: JSON.stringify({ type: "/problems/nothing", title: "nothing", status: 409, detail }) });
    expect(await world.line.undo({})).toBe(false);
    expect(world.line.refusal.value).toBe(detail);
    world.platform.answer = (method) => ({ status: 200, body: JSON.stringify(method === "POST" ? cutSession(0, 3) : STROKES) });
    expect(await world.line.redo({})).toBe(true);
    expect(world.line.refusal.value).toBeUndefined();
    world.platform.answer = () => {
      throw new Error("nobody answers");
    };
    expect(await world.line.undo({ since: 1 })).toBe(false);
    expect(world.line.refusal.value).toBe("the server did not answer");
  });

  it("does a second press no second time", async () => {
    const world = await watched();
    let release: () => void = () => undefined;
    world.platform.answer = (method) => method === "GET"
      ? { status: 200, body: JSON.stringify(STROKES) }
      : new Promise((resolve) => {
        release = () => resolve({ status: 200, body: JSON.stringify(cutSession(0, 2)) });
      });
    const first = world.line.undo({});
    expect(world.line.isBusy.value).toBe(true);
    expect(await world.line.undo({})).toBe(false);
    release();
    expect(await first).toBe(true);
    expect(world.line.isBusy.value).toBe(false);
    expect(world.platform.requests.filter(({ method }) => method === "POST")).toHaveLength(1);
  });

  it("keeps an answer from before an undo to itself", async () => {
    const world = await watched();
    let late: () => void = () => undefined;
    world.platform.answer = () => new Promise((resolve) => {
      late = () => resolve({ status: 200, body: JSON.stringify(STROKES) });
    });
    const end = world.line.watch();
    await world.platform.pass(0);
    const old = late;
    const undone: Strokes = { ...STROKES, strokes: [] };
    world.platform.answer = (method) => ({ status: 200, body: JSON.stringify(method === "POST" ? cutSession(0, 2) : undone) });
    await world.line.undo({});
    old();
    await world.platform.pass(0);
    expect(world.line.strokes.value).toEqual(undone);
    end();
  });

  it("is new once an undo is done, however often it is looked at meanwhile", async () => {
    const world = await watched();
    const end = world.line.watch();
    await pass(world, 2, () => cutSession(5));
    const undone: Strokes = { ...STROKES, strokes: [] };
    const waiting: (() => void)[] = [];
    world.platform.answer = (method) => method === "POST"
      ? { status: 200, body: JSON.stringify(cutSession(0, 2)) }
      : new Promise((resolve) => {
        waiting.push(() => resolve({ status: 200, body: JSON.stringify(undone) }));
      });
    const undo = world.line.undo({});
    await pass(world, 2, () => cutSession(0, 2));
    expect(waiting).toHaveLength(1);
    waiting[0]();
    expect(await undo).toBe(true);
    expect(world.line.strokes.value).toEqual(undone);
    end();
  });

  it("says why there is none, where a server has none", async () => {
    const world = await watched();
    world.platform.answer = () => ({ status: 404, body: "" });
    const end = world.line.watch();
    await world.platform.pass(10);
    expect(world.line.strokes.value).toBeUndefined();
    expect(world.line.refusal.value).toBe("the server answered 404 without saying why");
    end();
  });
});
