import { describe, expect, it } from "vitest";
import { encodeHeader, HEADER_BYTES, Kind } from "../protocol/header";
import type { Problem, Session } from "../protocol/session";
import { CHANNELS, encodeTelemetry } from "../protocol/telemetry";
import { encodeText } from "../protocol/text";
import { FakePlatform } from "./fake_platform";
import { fakeSession } from "./fake_session";
import { Live } from "./live";

const json = (value: unknown, status = 200): { status: number; body: string } => ({ status, body: JSON.stringify(value) });

const BROKEN = { code: 1006, reason: "" };

describe("the connection", () => {
  it("opens the stream of the session asked for, and subscribes", async () => {
    const { platform, live } = await connected([fakeSession({ id: "one" }), fakeSession({ id: "two" })], "two");
    expect(platform.lastSocket.path).toBe("api/v1/sessions/two/stream");
    expect(JSON.parse(platform.lastSocket.sent[0])).toEqual({ type: "subscribe", telemetry: "on", bricks: "on" });
    expect(live.isCurrent.value).toBe(true);
    expect(live.connection.sessions.value).toEqual(["one", "two"]);
  });

  it("tries again while the server is away, each time later, and comes back by itself", async () => {
    const platform = new FakePlatform();
    const live = new Live(platform);
    live.open(undefined);
    await platform.pass(0);
    expect(live.connection.phase.value.name).toBe("away");
    await platform.pass(30_000);
    const tries = platform.requests.length;
    expect(tries).toBeGreaterThan(8);
    expect(tries).toBeLessThan(18);
    platform.answer = () => json([fakeSession()]);
    await platform.pass(4000);
    platform.lastSocket.events.onOpen();
    expect(live.isCurrent.value).toBe(true);
  });

  it("asks for a token once where the server wants another, and again when there is one", async () => {
    const platform = new FakePlatform();
    const detail = "the request shows none";
    const problem = JSON.stringify({ type: "/problems/token", title: "a token is needed", status: 401, detail });
    platform.answer = () => ({ status: 401, body: problem });
    const live = new Live(platform);
    live.open(undefined);
    await platform.pass(60_000);
    expect(live.connection.phase.value).toEqual({ name: "locked", because: detail });
    expect(platform.requests).toHaveLength(1);
    platform.answer = () => ({ status: 200, body: "[]" });
    live.connection.retryNow();
    await platform.pass(1000);
    expect(live.connection.phase.value).toEqual({ name: "empty" });
  });

  it("is away as soon as the socket closes, and ignores what an old socket still says", async () => {
    const { platform, live } = await connected([fakeSession()]);
    const old = platform.lastSocket;
    old.events.onClose(BROKEN);
    expect(live.isCurrent.value).toBe(false);
    old.events.onText(state(fakeSession({ scheme: "wave" })));
    expect(live.session.value?.scheme).not.toBe("wave");
    await platform.pass(1000);
    expect(platform.lastSocket).not.toBe(old);
    platform.lastSocket.events.onOpen();
    old.events.onClose(BROKEN);
    expect(live.isCurrent.value).toBe(true);
  });

  it("says why the server closed the stream, until it is away for another reason", async () => {
    const { platform, live } = await connected([fakeSession()]);
    platform.lastSocket.events.onClose({ code: 1009, reason: "messages have at most 16384 bytes" });
    expect(live.connection.phase.value).toMatchObject({ name: "away", because: "messages have at most 16384 bytes (code 1009)" });
    await platform.pass(1000);
    platform.lastSocket.events.onClose(BROKEN);
    expect(live.connection.phase.value).toMatchObject({ name: "away", because: undefined });
  });

  it("gives up a socket that stays open in silence, and keeps one that answers pings", async () => {
    const { platform, live } = await connected([fakeSession()]);
    for (let second = 0; second < 10; second += 1) {
      await platform.pass(1000);
      const ping = platform.lastSocket.sent.at(-1) ?? "";
      platform.lastSocket.events.onText(ping.replace("ping", "pong"));
    }
    expect(live.isCurrent.value).toBe(true);
    expect(live.connection.ping_ms.value).toBe(0);
    const silent = platform.lastSocket;
    await platform.pass(5000);
    expect(silent.closed).toBe(true);
  });

  it("keeps a server that talks while the page is too busy to listen", async () => {
    const { platform, live } = await connected([fakeSession()]);
    const { events } = platform.lastSocket;
    for (let n = 0; n < 5; n += 1) {
      await platform.sleep(10_000);
      events.onText(state(fakeSession()));
    }
    expect(live.isCurrent.value).toBe(true);
    expect(platform.sockets).toHaveLength(1);
  });

  it("says when there is no session, and finds the first one made", async () => {
    const platform = new FakePlatform();
    platform.answer = () => json([]);
    const live = new Live(platform);
    live.open(undefined);
    await platform.pass(2000);
    expect(live.connection.phase.value.name).toBe("empty");
    platform.answer = () => json([fakeSession({ id: "new" })]);
    await platform.pass(2000);
    expect(platform.lastSocket.path).toContain("/new/");
  });
});

describe("what the stream brings", () => {
  it("shows state, telemetry and events, and passes bricks on undecoded", async () => {
    const { platform, live } = await connected([fakeSession()]);
    const { events } = platform.lastSocket;
    events.onText(state(fakeSession({ scheme: "tdpa" })));
    expect(live.session.value?.scheme).toBe("tdpa");
    events.onText(encodeText({ type: "event", level: "warning", text: "no frame for 0.1 s", time_s: 12.5 }));
    expect(live.notices.value[0]).toMatchObject({ level: "warning", text: "no frame for 0.1 s", time_s: 12.5 });
    events.onBinary(encodeTelemetry({ sequence: 1, tool: 1, period_us: 1000, dropped: 3, first_time_s: 4, values: new Float32Array(CHANNELS) }));
    expect(live.history.newest_s).toBe(4);
    const passed: ArrayBuffer[] = [];
    live.onBricks = (bytes) => passed.push(bytes);
    const bricks = new ArrayBuffer(HEADER_BYTES);
    encodeHeader(new DataView(bricks), { kind: Kind.bricks, sequence: 2 });
    events.onBinary(bricks);
    expect(passed).toEqual([bricks]);
  });

  it("says what it cannot understand, once, and goes on", async () => {
    const { platform, live } = await connected([fakeSession()]);
    for (let n = 0; n < 5; n += 1) platform.lastSocket.events.onText('{"type":"gossip"}');
    platform.lastSocket.events.onText(state(fakeSession({ scheme: "wave" })));
    expect(live.notices.value).toHaveLength(1);
    expect(live.notices.value[0].level).toBe("error");
    expect(live.session.value?.scheme).toBe("wave");
  });

  it("keeps the parts of the state that did not change, so that nothing redraws for them", async () => {
    const { platform, live } = await connected([fakeSession()]);
    platform.lastSocket.events.onText(state(fakeSession()));
    const before = live.session.value;
    platform.lastSocket.events.onText(state(fakeSession({ coordination_m: 1 })));
    expect(live.session.value).not.toBe(before);
    expect(live.session.value?.network).toBe(before?.network);
    expect(live.session.value?.coordination_m).toBe(1);
  });

  it("forgets telemetry of another run of the server", async () => {
    const { platform, live } = await connected([fakeSession()]);
    const telemetry = { sequence: 1, tool: 1, period_us: 1000, dropped: 0, first_time_s: 4, values: new Float32Array(CHANNELS) };
    platform.lastSocket.events.onBinary(encodeTelemetry(telemetry));
    platform.lastSocket.events.onText(encodeText({ type: "hello", protocol: 1, session: "demo", server_version: "0.1.0" }));
    expect(live.history.isEmpty).toBe(true);
    expect(live.serverVersion.value).toBe("0.1.0");
  });
});

describe("an edit", () => {
  it("is shown as a wish until the server has confirmed it", async () => {
    const { platform, live } = await connected([fakeSession()]);
    platform.lastSocket.events.onText(state(fakeSession()));
    platform.answer = () => json(fakeSession({ scheme: "wave" }));
    live.edits.wish({ "/scheme": "wave" });
    expect(live.edits.of("/scheme").value).toEqual({ name: "wished", value: "wave" });
    expect(live.session.value?.scheme).toBe("replica");
    await platform.pass(200);
    expect(live.edits.of("/scheme").value.name).toBe("settled");
    expect(live.session.value?.scheme).toBe("wave");
  });

  it("sends nested settings as one patch, and only the newest of many", async () => {
    const { platform, live } = await connected([fakeSession()]);
    platform.lastSocket.events.onText(state(fakeSession()));
    let release: () => void = () => undefined;
    platform.answer = () => new Promise((resolve) => {
      release = () => resolve(json(fakeSession()));
    });
    live.edits.wish({ "/network/up/delay_s": 0.001, "/network/down/delay_s": 0.001 });
    await platform.pass(100);
    for (let n = 2; n <= 20; n += 1) live.edits.wish({ "/network/up/delay_s": n / 1000 });
    await platform.pass(1000);
    release();
    await platform.pass(1000);
    release();
    await platform.pass(1000);
    const patches = platform.requests.filter(({ method }) => method === "PATCH").map(({ body }) => body);
    expect(patches).toEqual([
      { network: { up: { delay_s: 0.001 }, down: { delay_s: 0.001 } } },
      { network: { up: { delay_s: 0.02 } } },
    ]);
    expect(live.edits.of("/network/up/delay_s").value.name).toBe("settled");
  });

  it("that is refused says why at its field and leaves the server's value", async () => {
    const { platform, live } = await connected([fakeSession()]);
    platform.lastSocket.events.onText(state(fakeSession()));
    const problem: Problem = {
      type: "/problems/field", title: "a field is not acceptable", status: 422, detail: "3 is not a number from 0 to 2",
      pointer: "/network/down/delay_s",
    };
    platform.answer = () => json(problem, 422);
    live.edits.wish({ "/network/up/delay_s": 3, "/network/down/delay_s": 3 });
    await platform.pass(200);
    expect(live.edits.of("/network/down/delay_s").value).toEqual({ name: "refused", detail: problem.detail });
    expect(live.edits.of("/network/up/delay_s").value.name).toBe("settled");
    expect(live.session.value?.network.up.delay_s).toBe(0);
  });

  it("that nobody answers says so, and so does an answer without an explanation", async () => {
    const { platform, live } = await connected([fakeSession()]);
    platform.lastSocket.events.onText(state(fakeSession()));
    platform.answer = () => {
      throw new Error("gone");
    };
    live.edits.wish({ "/paused": true });
    await platform.pass(200);
    expect(live.edits.of("/paused").value).toEqual({ name: "refused", detail: "the server did not answer" });
    platform.answer = () => ({ status: 502, body: "<html>bad gateway</html>" });
    live.edits.wish({ "/paused": true });
    await platform.pass(200);
    expect(live.edits.of("/paused").value).toMatchObject({ detail: expect.stringContaining("502") as string });
  });
});

describe("quality", () => {
  it("tells the loss of the last seconds, not of the whole run", async () => {
    const { platform, live } = await connected([fakeSession()]);
    const say = (ticks: number, lost: number, late_ticks: number, packets_up_per_s: number): void => {
      const session = fakeSession();
      // The rate is measured, and wavers about its aim.
      const rate_hz = ticks % 200 === 0 ? 1000.3 : 999.7;
      platform.lastSocket.events.onText(state({ ...session, loop: { ...session.loop, rate_hz, ticks, lost, late_ticks, packets_up_per_s } }));
    };
    say(1_000_000, 50_000, 0, 1000);
    expect(live.quality.value.loss).toBeUndefined();
    for (let n = 1; n <= 50; n += 1) say(1_000_000 + 100 * n, 50_000 + 10 * n, 2 * n, 900);
    expect(live.quality.value.loss).toBeCloseTo(0.1, 3);
    expect(live.quality.value.latePerS).toBeCloseTo(20, 1);
    for (let n = 51; n <= 100; n += 1) say(1_000_000 + 100 * n, 50_500, 100, 1000);
    expect(live.quality.value.loss).toBe(0);
  });
});

async function connected(sessions: Session[], wanted?: string): Promise<{ platform: FakePlatform; live: Live }> {
  const platform = new FakePlatform();
  platform.answer = () => json(sessions);
  const live = new Live(platform);
  live.open(wanted);
  await platform.pass(0);
  platform.lastSocket.events.onOpen();
  return { platform, live };
}

const state = (session: Session): string => encodeText({ type: "state", session });
