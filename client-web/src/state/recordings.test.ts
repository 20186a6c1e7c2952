import { describe, expect, it } from "vitest";
import type { Recording } from "../protocol/recording";
import { FakePlatform } from "./fake_platform";
import { fakeSession } from "./fake_session";
import { Live } from "./live";
import { Recordings } from "./recordings";

const ENDED: Recording = { id: "a", state: "ended", reason: null, bytes: 5e6, ticks: 60_000, dropped: 0, is_temporary: false };
const RUNNING: Recording = { ...ENDED, id: "b", state: "recording" };

interface World {
  readonly platform: FakePlatform;
  readonly recordings: Recordings;
  /** What the server has. */
  list: readonly Recording[];
  readonly asked: () => number;
  /** Lets time pass, with the signs of life that keep the stream open. */
  readonly pass: (seconds: number, session?: string) => Promise<void>;
}

async function world(): Promise<World> {
  const platform = new FakePlatform();
  const live = new Live(platform);
  const made: World = {
    platform, recordings: new Recordings(platform, live), list: [ENDED],
    asked: () => platform.requests.filter(({ method, path }) => method === "GET" && path.endsWith("/recordings")).length,
    pass: async (seconds, id = "demo") => {
      for (let n = 0; n < 4 * seconds; n += 1) {
        platform.lastSocket.events.onText(JSON.stringify({ type: "state", session: { ...fakeSession(), id } }));
        await platform.pass(250);
      }
    },
  };
  platform.answer = (_method, path) => ({ status: 200, body: JSON.stringify(path.endsWith("/recordings") ? made.list : [fakeSession()]) });
  live.open(undefined);
  await platform.pass(0);
  platform.lastSocket.events.onOpen();
  return made;
}

describe("recordings", () => {
  it("are asked for every second while one goes on, seldom while none does, and never when nobody looks", async () => {
    const there = await world();
    const end = there.recordings.watch();
    await there.pass(20);
    expect(there.recordings.list.value).toEqual([ENDED]);
    expect(there.recordings.running.value).toBeUndefined();
    expect(there.asked()).toBeGreaterThan(2);
    expect(there.asked()).toBeLessThan(7);
    there.list = [ENDED, RUNNING];
    await there.pass(6);
    const before = there.asked();
    await there.pass(10);
    expect(there.recordings.running.value).toEqual(RUNNING);
    expect(there.asked() - before).toBeGreaterThan(6);
    expect(there.asked() - before).toBeLessThan(12);
    end();
    const all = there.asked();
    await there.pass(20);
    expect(there.asked()).toBe(all);
  });

  it("begin, end and go at a press each, and the list is new at once", async () => {
    const there = await world();
    const end = there.recordings.watch();
    await there.pass(1);
    const { platform, recordings } = there;
    platform.answer = (method, path) => {
      if (method === "POST") there.list = path.endsWith("/stop") ? [ENDED, { ...RUNNING, state: "ended" }] : [ENDED, RUNNING];
      if (method === "DELETE") there.list = [ENDED];
      return { status: method === "DELETE" ? 204 : 200, body: method === "DELETE" ? "" : JSON.stringify(method === "GET" ? there.list : RUNNING) };
    };
    expect(await recordings.start()).toBe(true);
    expect(recordings.running.value).toEqual(RUNNING);
    expect(await recordings.end("b")).toBe(true);
    expect(recordings.running.value).toBeUndefined();
    expect(recordings.list.value).toHaveLength(2);
    expect(await recordings.remove("b")).toBe(true);
    expect(recordings.list.value).toEqual([ENDED]);
    expect(platform.requests.filter(({ method }) => method !== "GET")).toEqual([
      { method: "POST", path: "api/v1/sessions/demo/recordings", body: {} },
      { method: "POST", path: "api/v1/sessions/demo/recordings/b/stop", body: undefined },
      { method: "DELETE", path: "api/v1/sessions/demo/recordings/b", body: undefined },
    ]);
    end();
  });

  it("say why one was not begun, and whose list they are", async () => {
    const there = await world();
    const end = there.recordings.watch();
    await there.pass(1);
    const detail = "the disk is full";
    there.platform.answer = (method) => method === "GET"
      ? { status: 200, body: "[]" }
      : { status: 503, body: JSON.stringify({ type: "/problems/storage", title: "storage", status: 503, detail }) };
    expect(await there.recordings.start()).toBe(false);
    expect(there.recordings.refusal.value).toBe(detail);
    there.platform.answer = () => {
      throw new Error("nobody answers");
    };
    await there.pass(1, "other");
    expect(there.recordings.list.value).toBeUndefined();
    expect(there.recordings.refusal.value).toBe("the recordings of this session are not to be had");
    end();
  });
});
