import { describe, expect, it } from "vitest";
import type { FromHand } from "../hand/port";
import { Conversation, type Standing } from "./conversation";
import { FakeHand, fakeHandState, grantText, stateOf, text } from "./fake_hand";
import { FakePlatform } from "./fake_platform";

const DEVICE = { name: "mouse", axes: 2, force_n: 0, rate_hz: 60, measures_force: false } as const;
const JOIN = { type: "join", operator: "Ada", device: DEVICE };
const OFF = { type: "subscribe", telemetry: "off", bricks: "off" };
const LOST = fakeHandState({ silence_s: 1.2, wanted: { parameters: false, lease: true, snapshot: undefined } });
const closed = (reason = ""): FromHand => ({ type: "closed", code: 1006, reason });

class Talk {
  readonly platform = new FakePlatform();
  readonly hand = new FakeHand();
  readonly standings: Standing[] = [];
  readonly troubles: string[] = [];
  begun = 0;
  readonly conversation = new Conversation(this.platform, this.hand, {
    onStanding: (standing) => this.standings.push(standing),
    onBegun: () => { this.begun += 1; },
    onTrouble: (says) => this.troubles.push(says),
  });

  get standing(): Standing | undefined {
    return this.standings.at(-1);
  }

  begin(): void {
    this.conversation.begin({ session: "demo", name: "Ada", device: DEVICE, motion: 1 });
  }

  take(...messages: FromHand[]): void {
    for (const message of messages) this.conversation.take(message);
  }

  /** Holds a tool, and the loop has been heard from. */
  static held(): Talk {
    const talk = new Talk();
    talk.begin();
    talk.take({ type: "open" }, text(grantText()), stateOf(fakeHandState()));
    talk.hand.forget();
    return talk;
  }
}

describe("a tool is asked for", () => {
  it("on a socket that hears of nothing else, and once it is granted nobody holds it yet", () => {
    const talk = new Talk();
    talk.begin();
    expect(talk.hand.sockets).toEqual(["demo"]);
    expect(talk.hand.asked).toEqual([]);
    talk.take({ type: "open" }, text({ type: "hello", protocol: 9, session: "demo", server_version: "9" }));
    expect(talk.hand.asked).toEqual([OFF, JOIN]);
    expect(talk.standing).toEqual({ name: "asking" });
    talk.take(text(grantText({ tool: 2 })));
    expect(talk.standing).toEqual({ name: "in", tool: 2, node: "lab", lease_s: 10 });
    expect(talk.hand.orders).toEqual(["begin", "release"]);
    const begin = talk.hand.told.find((message) => message.type === "begin");
    expect(new Uint8Array(begin?.keys ?? new ArrayBuffer(0))).toEqual(Uint8Array.from({ length: 64 }, (_, n) => (n < 32 ? 7 : 11)));
    expect(JSON.parse(begin?.granted ?? "")).toMatchObject({ lease: 1, ownership_epoch: 1, parameters: { revision: 3 } });
    expect(begin?.device).toEqual({ rate_hz: 60, motion: 1 });
    expect(talk.begun).toBe(1);
  });

  it("and refused by whom, and why; there is no loop then, and no socket", () => {
    const talk = new Talk();
    talk.begin();
    talk.take({ type: "open" }, text({ type: "refused", code: "reserved", reason: "kept for Bob", holder: "Bob" }));
    expect(talk.standing).toEqual({ name: "out", because: { kind: "refused", code: "reserved", reason: "kept for Bob", holder: "Bob" } });
    expect(talk.hand.hasEnded).toBe(true);
  });

  it("again for a while where the server is busy, and not for ever", async () => {
    const talk = new Talk();
    talk.begin();
    talk.take({ type: "open" });
    const joins = (): number => talk.hand.asked.filter((asked) => JSON.stringify(asked) === JSON.stringify(JOIN)).length;
    for (let n = 1; talk.standing?.name === "asking"; n += 1) {
      expect(joins()).toBe(n);
      talk.take(text({ type: "refused", code: "busy", reason: "a moment" }));
      await talk.platform.pass(5000 - 1);
    }
    expect(joins()).toBe(8);
    expect(talk.standing).toMatchObject({ name: "out", because: { reason: "a moment" } });
  });

  it("of a server that knows no such thing, that is silent, that closes, or whose answer is none", async () => {
    const troubles: [string, (talk: Talk) => void | Promise<void>][] = [
      ["unknown type", (talk) => talk.take({ type: "open" }, text({ type: "problem", problem: { detail: "unknown type", status: 400 } }))],
      ["the server did not answer", async (talk) => { await talk.platform.pass(5000); }],
      ["the server did not answer", async (talk) => { talk.take({ type: "open" }); await talk.platform.pass(5000); }],
      ["the line to the server broke", (talk) => talk.take(closed())],
      ["no such session", (talk) => talk.take({ type: "closed", code: 4404, reason: "no such session" })],
      ["there is no hand", (talk) => talk.take({ type: "trouble", says: "there is no hand" })],
      ["the server's answer was not understood: keys: wanted 128 hexadecimal digits", (talk) => {
        talk.take({ type: "open" }, text({ ...Object(grantText()), keys: "07" }));
      }],
    ];
    for (const [reason, happens] of troubles) {
      const talk = new Talk();
      talk.begin();
      await happens(talk);
      expect(talk.standing).toEqual({ name: "out", because: { kind: "trouble", reason } });
      expect(talk.hand.hasEnded).toBe(true);
      talk.take(text(grantText()));
      expect(talk.standing?.name).toBe("out");
    }
  });
});

describe("a lease that is lost", () => {
  it("is asked for again over the same line, and the loop goes on, held by nobody", async () => {
    const talk = Talk.held();
    talk.take(stateOf(LOST));
    expect(talk.standing).toEqual({ name: "again", tool: 1, because: "nothing was heard from the server for 1.2 s", attempts: 0 });
    expect(talk.hand.orders).toEqual(["release"]);
    await talk.platform.pass(250);
    expect(talk.hand.asked).toEqual([JOIN]);
    talk.hand.forget();
    talk.take(text(grantText({ lease: 2 })));
    expect(talk.standing?.name).toBe("in");
    expect(talk.hand.orders).toEqual(["renew", "release"]);
    // What the worker told before it heard of the lease is no loss of that.
    talk.take(stateOf(LOST));
    expect(talk.standing?.name).toBe("in");
    talk.take(stateOf(fakeHandState()), stateOf(LOST));
    expect(talk.standing?.name).toBe("again");
  });

  it("goes on where the server is heard again by itself; a lease that was on its way counts all the same", async () => {
    const talk = Talk.held();
    talk.take(stateOf(LOST));
    await talk.platform.pass(250);
    talk.take(stateOf(fakeHandState()));
    expect(talk.standing).toMatchObject({ name: "in", tool: 1 });
    talk.hand.forget();
    talk.take(text(grantText({ lease: 2 })));
    expect(talk.hand.orders).toEqual(["renew", "release"]);
    talk.hand.forget();
    talk.take(text(grantText({ lease: 3 })));
    expect(talk.hand.orders).toEqual([]);
  });

  it("with its line is asked for on another one, with growing pauses, though the old lease is in the way", async () => {
    const talk = Talk.held();
    talk.take(closed());
    expect(talk.standing).toMatchObject({ name: "again", because: "the line to the server broke" });
    await talk.platform.pass(250);
    expect(talk.hand.sockets).toEqual(["demo", "demo"]);
    talk.take({ type: "open" });
    expect(talk.hand.asked).toEqual([OFF, JOIN]);
    const waits: number[] = [];
    for (let n = 0; n < 6; n += 1) {
      const before = talk.hand.asked.length;
      const began_ms = talk.platform.now_ms();
      talk.take(text({ type: "refused", code: "no_free_tool", reason: "all held" }));
      while (talk.hand.asked.length === before) await talk.platform.pass(25);
      waits.push(talk.platform.now_ms() - began_ms);
    }
    expect(waits).toEqual([375, 750, 1500, 3000, 3000, 3000]);
    talk.take(text(grantText({ lease: 2 })));
    expect(talk.standing?.name).toBe("in");
  });

  it("is given up where the server says no for good, or after two minutes", async () => {
    const refused = Talk.held();
    refused.take(closed());
    await refused.platform.pass(250);
    refused.take({ type: "open" }, text({ type: "refused", code: "stopped", reason: "stopped by Bob: a pause" }));
    expect(refused.standing).toMatchObject({ name: "out", because: { code: "stopped", reason: "stopped by Bob: a pause" } });
    const alone = Talk.held();
    alone.take(closed());
    await alone.platform.pass(110_000);
    expect(alone.standing?.name).toBe("again");
    await alone.platform.pass(30_000);
    expect(alone.standing).toMatchObject({ name: "out", because: { kind: "trouble" } });
    expect(alone.hand.sockets.length).toBeLessThan(30);
  });

  it("of another loop begins anew, once the one that was there is at rest", () => {
    const talk = Talk.held();
    talk.take(closed());
    talk.conversation.take({ type: "open" });
    talk.take(text(grantText({ lease: 2 })));
    talk.hand.forget();
    talk.take({ type: "refused", of: "renew", says: "the grant is of another loop" });
    expect(talk.hand.orders).toEqual(["leave"]);
    talk.take(stateOf(fakeHandState({ mode: "braking" })));
    expect(talk.hand.orders).toEqual(["leave"]);
    talk.take(stateOf(fakeHandState({ mode: "resting" })), stateOf(fakeHandState({ mode: "resting" })));
    expect(talk.hand.orders).toEqual(["leave", "begin"]);
    expect(JSON.parse(talk.hand.told.find((message) => message.type === "begin")?.granted ?? "")).toMatchObject({ lease: 2 });
    expect(talk.begun).toBe(2);
  });
});

describe("the last word", () => {
  it("of the server ends the lease and keeps the loop, which goes on where the person wants the tool again", () => {
    const talk = Talk.held();
    talk.take(text({ type: "farewell", reason: "Bob has stopped the session: a cable" }));
    expect(talk.standing).toEqual({ name: "out", because: { kind: "farewell", reason: "Bob has stopped the session: a cable" } });
    expect(talk.hand.orders).toEqual(["release", "disconnect"]);
    expect(talk.hand.hasEnded).toBe(false);
    // Nothing is asked for by itself.
    talk.take(stateOf(LOST));
    expect(talk.standing?.name).toBe("out");
    talk.hand.forget();
    talk.begin();
    talk.take({ type: "open" }, text(grantText({ lease: 2 })));
    expect(talk.hand.orders).toEqual(["renew", "release"]);
  });

  it("of the page comes once the hand is at rest, and its worker ends when the server has heard it, or does not answer", async () => {
    const talk = Talk.held();
    talk.conversation.leave();
    expect(talk.hand.orders).toEqual(["leave"]);
    expect(talk.hand.asked).toEqual([]);
    talk.take(stateOf(fakeHandState({ mode: "resting" })));
    expect(talk.hand.asked).toEqual([{ type: "leave" }]);
    talk.take(text({ type: "left" }));
    expect(talk.standing).toEqual({ name: "out", because: undefined });
    expect(talk.hand.hasEnded).toBe(true);
    const silent = Talk.held();
    silent.conversation.leave();
    await silent.platform.pass(1499);
    expect(silent.hand.hasEnded).toBe(false);
    expect(silent.hand.asked).toEqual([{ type: "leave" }]);
    await silent.platform.pass(1);
    expect(silent.hand.hasEnded).toBe(true);
  });

  it("is said also where a grant is on its way", async () => {
    const talk = new Talk();
    talk.begin();
    talk.take({ type: "open" });
    talk.conversation.leave();
    talk.take(text(grantText()));
    expect(talk.hand.asked.at(-1)).toEqual({ type: "leave" });
    expect(talk.hand.orders).toEqual([]);
    await talk.platform.pass(1000);
    expect(talk.hand.hasEnded).toBe(true);
  });
});

describe("what the loop wants", () => {
  const wanting = (wanted: Partial<typeof LOST.wanted>): FromHand =>
    stateOf(fakeHandState({ wanted: { parameters: false, lease: false, snapshot: undefined, ...wanted } }));

  it("of parameters is asked once, and again where what came was old", async () => {
    const talk = Talk.held();
    talk.take(wanting({ parameters: true }), wanting({ parameters: true }));
    expect(talk.hand.asked).toEqual([{ type: "parameters" }]);
    talk.take(text({ type: "parameters", parameters: { revision: 7, axes: 2 } }));
    expect(talk.hand.told.at(-1)).toEqual({ type: "parameters", json: '{"revision":7,"axes":2}' });
    talk.take(wanting({ parameters: true }));
    expect(talk.hand.asked).toHaveLength(1);
    await talk.platform.pass(100);
    talk.take(wanting({ parameters: true }));
    expect(talk.hand.asked).toHaveLength(2);
  });

  it("of clay is asked once for each want, and goes to the loop when all of it is there", async () => {
    const talk = Talk.held();
    const brick = (n: number): FromHand => ({ type: "binary", bytes: Uint8Array.from([0x54, 0x43, 1, 2, n]).buffer });
    talk.take(brick(9), wanting({ snapshot: { number: 1, epoch: 4 } }), wanting({ snapshot: { number: 1, epoch: 4 } }));
    expect(talk.hand.asked).toEqual([{ type: "snapshot", epoch: 4 }]);
    const clay = { shape: { kind: "block" }, voxel_size_m: 0.001, epoch: 4, revision: 8 };
    talk.take(text({ type: "snapshot", clay, messages: 2 }), brick(1));
    expect(talk.hand.orders).toEqual([]);
    talk.take({ type: "binary", bytes: Uint8Array.from([0x54, 0x43, 1, 1, 0]).buffer }, brick(2), brick(3));
    const snapshot = talk.hand.told.find((message) => message.type === "snapshot");
    expect(JSON.parse(snapshot?.description ?? "")).toEqual(clay);
    expect(snapshot?.bricks.map((bytes) => new Uint8Array(bytes)[4])).toEqual([1, 2]);
    talk.take(wanting({ snapshot: { number: 1, epoch: 4 } }));
    expect(talk.hand.asked).toHaveLength(1);
    talk.take(wanting({ snapshot: { number: 2, epoch: 5 } }));
    expect(talk.hand.asked.at(-1)).toEqual({ type: "snapshot", epoch: 5 });
    await talk.platform.pass(10_000);
    talk.take(wanting({ snapshot: { number: 2, epoch: 5 } }));
    expect(talk.hand.asked).toHaveLength(3);
  });

  it("and does not take is said once, and asked for again", async () => {
    const talk = Talk.held();
    talk.take(wanting({ snapshot: { number: 1, epoch: 4 } }), text({ type: "snapshot", clay: { epoch: 4, revision: 0 }, messages: 0 }));
    expect(talk.hand.orders).toEqual(["snapshot"]);
    talk.take({ type: "refused", of: "snapshot", says: "no clay" }, { type: "refused", of: "snapshot", says: "no clay" });
    expect(talk.troubles).toEqual(["the hand did not take the clay: no clay"]);
    await talk.platform.pass(1000);
    talk.take(wanting({ snapshot: { number: 1, epoch: 4 } }));
    expect(talk.hand.asked).toHaveLength(2);
  });
});
