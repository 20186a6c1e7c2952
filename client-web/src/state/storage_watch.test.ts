import { describe, expect, it } from "vitest";
import { FakePlatform } from "./fake_platform";
import { fakeSession } from "./fake_session";
import { Live } from "./live";
import { StorageWatch } from "./storage_watch";

describe("storage", () => {
  it("that is behind is told once it has been for two seconds on end", () => {
    const watch = new StorageWatch();
    const told = [0, 500, 1999, 2000, 2001, 60_000].map((now_ms) => watch.look("behind", now_ms));
    expect(told).toEqual(["fine", "fine", "fine", "fine", "behind", "behind"]);
    expect(watch.look("durable", 60_100)).toBe("fine");
    expect(watch.look("behind", 60_200)).toBe("fine");
    expect(watch.look("behind", 62_300)).toBe("behind");
  });

  it("that failed is told at once, and so is that there is none", () => {
    const watch = new StorageWatch();
    expect([watch.look("failed", 0), watch.look("ephemeral", 1), watch.look("durable", 2)]).toEqual(["failed", "ephemeral", "fine"]);
  });

  it("is followed as state comes in, and another session starts afresh", async () => {
    const platform = new FakePlatform();
    platform.answer = () => ({ status: 200, body: JSON.stringify([fakeSession()]) });
    const live = new Live(platform);
    const behind = fakeSession({ storage: { state: "behind", durable_revision: 0, bytes: 1, reason: null } });
    live.open(undefined);
    await platform.pass(0);
    const tell = (): void => platform.lastSocket.events.onText(JSON.stringify({ type: "state", session: behind }));
    platform.lastSocket.events.onOpen();
    tell();
    expect(live.storage.value).toBe("fine");
    await platform.pass(2500);
    tell();
    expect(live.storage.value).toBe("behind");
    platform.lastSocket.events.onText(JSON.stringify({ type: "hello", protocol: 1, session: "demo", server_version: "1" }));
    tell();
    expect(live.storage.value).toBe("fine");
  });
});
