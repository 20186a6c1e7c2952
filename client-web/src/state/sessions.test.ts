import { describe, expect, it } from "vitest";
import type { DamagedSession, SessionEntry } from "../protocol/session";
import { FakePlatform } from "./fake_platform";
import { fakeSession } from "./fake_session";
import { Live } from "./live";
import { Sessions } from "./sessions";

const DAMAGED: DamagedSession = {
  id: "torn", state: "damaged",
  storage: { state: "failed", durable_revision: 0, bytes: 4096, reason: "segment 3 ends in the middle of a record" },
};

interface Listed {
  readonly platform: FakePlatform;
  readonly live: Live;
  readonly sessions: Sessions;
}

function listed(entries: readonly SessionEntry[]): Listed {
  const platform = new FakePlatform();
  platform.answer = () => ({ status: 200, body: JSON.stringify(entries) });
  const live = new Live(platform);
  return { platform, live, sessions: new Sessions(platform, live) };
}

describe("the list of sessions", () => {
  it("has whole ones and damaged ones, each for what it is", async () => {
    const { sessions } = listed([fakeSession({ id: "a" }), DAMAGED]);
    await sessions.look();
    expect(sessions.entries).toEqual([fakeSession({ id: "a" }), DAMAGED]);
  });

  it("offers damaged ones nowhere to be opened, and the stream goes to none of them", async () => {
    const { platform, live, sessions } = listed([DAMAGED, fakeSession({ id: "a" })]);
    live.open("torn");
    await platform.pass(0);
    expect(platform.lastSocket.path).toBe("api/v1/sessions/a/stream");
    await sessions.look();
    expect(live.connection.sessions.value).toEqual(["a"]);
  });

  it("tells a fault of the entry that is at fault", async () => {
    for (const [entry, says] of [
      [{ ...fakeSession(), scheme: "telepathy" }, /0\.scheme/],
      [{ ...DAMAGED, storage: { ...DAMAGED.storage, bytes: "many" } }, /0\.storage\.bytes/],
      [{ ...fakeSession(), state: "asleep" }, /0\.state/],
    ] as const) {
      const { platform, sessions } = listed([]);
      platform.answer = () => ({ status: 200, body: JSON.stringify([entry]) });
      await sessions.look();
      expect(sessions.state.value).toMatchObject({ name: "away" });
      expect(JSON.stringify(sessions.state.value)).toMatch(says);
    }
  });

  it("is looked at every second while somebody looks at it, and stays on show when the server is away", async () => {
    const { platform, sessions } = listed([fakeSession()]);
    const end = sessions.watch();
    await platform.pass(4500);
    expect(platform.requests).toHaveLength(5);
    platform.answer = () => {
      throw new Error("nobody answers");
    };
    await platform.pass(1000);
    expect(sessions.state.value).toEqual({ name: "away", entries: [fakeSession()], because: "the server did not answer" });
    end();
    await platform.pass(10_000);
    expect(platform.requests).toHaveLength(6);
  });

  it("is told to whoever chooses a session, and an empty page finds the first one made", async () => {
    const { platform, live, sessions } = listed([]);
    live.open(undefined);
    await platform.pass(0);
    expect(live.connection.phase.value.name).toBe("empty");
    platform.answer = () => ({ status: 200, body: JSON.stringify([fakeSession({ id: "first" })]) });
    await sessions.look();
    await platform.pass(0);
    expect(platform.lastSocket.path).toBe("api/v1/sessions/first/stream");
  });

  it("has what was made, and lacks what was deleted, as soon as that is done", async () => {
    const { platform, sessions } = listed([]);
    let entries: SessionEntry[] = [];
    platform.answer = (method, path, body) => {
      if (method === "POST" && path.endsWith("/duplicate")) entries = [...entries, fakeSession({ id: (body as { id: string }).id })];
      else if (method === "POST") entries = [fakeSession({ id: (body as { id: string }).id })];
      else if (method === "DELETE") entries = entries.filter(({ id }) => !path.endsWith(`/${id}`));
      return { status: method === "DELETE" ? 204 : 200, body: method === "DELETE" ? "" : JSON.stringify(method === "GET" ? entries : entries.at(-1)) };
    };
    expect(await sessions.create({ id: "a" })).toBeUndefined();
    expect(await sessions.duplicate("a", "b")).toBeUndefined();
    expect(sessions.entries.map(({ id }) => id)).toEqual(["a", "b"]);
    expect(await sessions.remove("a")).toBeUndefined();
    expect(sessions.entries.map(({ id }) => id)).toEqual(["b"]);
    expect(platform.requests.filter(({ method }) => method !== "GET").map(({ method, path }) => `${method} ${path}`)).toEqual(
      ["POST api/v1/sessions", "POST api/v1/sessions/a/duplicate", "DELETE api/v1/sessions/a"]);
  });

  it("says in the server's words why something was not done", async () => {
    const { platform, sessions } = listed([]);
    const problem = { type: "/problems/exists", title: "it exists", status: 409, detail: "there is a session a" };
    platform.answer = (method) => (method === "GET" ? { status: 200, body: "[]" } : { status: 409, body: JSON.stringify(problem) });
    expect(await sessions.create({ id: "a" })).toBe("there is a session a");
    platform.answer = () => {
      throw new Error("nobody answers");
    };
    expect(await sessions.remove("a")).toBe("the server did not answer");
  });
});
