import { describe, expect, it } from "vitest";
import type { FromHand } from "../hand/port";
import { FakeHand, fakeCounts, fakeHandState, grantText, stateOf, text } from "./fake_hand";
import { FakePlatform } from "./fake_platform";
import { Operating } from "./operating";

const DEVICE = { name: "mouse", axes: 2, force_n: 0, rate_hz: 60, measures_force: false } as const;

class Bench {
  readonly platform = new FakePlatform();
  readonly hands: FakeHand[] = [];
  readonly tellers: ((message: FromHand) => void)[] = [];
  readonly reports: string[] = [];
  letGo = 0;
  readonly operating = new Operating(this.platform, (onMessage) => {
    const hand = new FakeHand();
    this.hands.push(hand);
    this.tellers.push(onMessage);
    return hand;
  }, (says) => this.reports.push(says));

  static async held(): Promise<Bench> {
    const bench = new Bench();
    bench.operating.onLetGo = () => { bench.letGo += 1; };
    bench.operating.operate("demo", "Ada", DEVICE);
    bench.tell({ type: "open" }, text(grantText()));
    await bench.states(600, () => fakeHandState());
    bench.hand.forget();
    return bench;
  }

  get hand(): FakeHand {
    const hand = this.hands.at(-1);
    if (hand === undefined) throw new Error("no worker was made");
    return hand;
  }

  tell(...messages: FromHand[]): void {
    for (const message of messages) this.tellers.at(-1)?.(message);
  }

  /** Sixty states a second. */
  async states(span_ms: number, state: (ticks: number) => ReturnType<typeof fakeHandState>): Promise<void> {
    const end_ms = this.platform.now_ms() + span_ms;
    while (this.platform.now_ms() < end_ms) {
      await this.platform.pass(1000 / 60);
      const made = state(this.platform.now_ms());
      this.tell(stateOf({ ...made, counts: { ...made.counts, ticks: Math.floor(this.platform.now_ms()) } }));
    }
  }
}

describe("operating", () => {
  it("makes no worker before somebody does, and one for a tool that is taken, given back and taken", () => {
    const bench = new Bench();
    expect(bench.hands).toHaveLength(0);
    bench.operating.operate("demo", "Ada", DEVICE);
    bench.operating.operate("demo", "Ada", DEVICE);
    expect(bench.hands).toHaveLength(1);
    bench.tell({ type: "open" }, text(grantText()));
    expect(bench.operating.tool.value).toBe(1);
    bench.operating.release();
    bench.tell(stateOf(fakeHandState({ mode: "resting" })), text({ type: "left" }));
    expect([bench.hand.hasEnded, bench.operating.tool.value, bench.operating.hand.value]).toEqual([true, undefined, undefined]);
    bench.operating.operate("demo", "Ada", DEVICE);
    expect(bench.hands).toHaveLength(2);
    // What the first one still says is nobody's.
    bench.tellers[0](stateOf(fakeHandState()));
    expect(bench.operating.hand.value).toBeUndefined();
  });

  it("tells a loop that begins what is set, and each change once", () => {
    const bench = new Bench();
    bench.operating.set({ motion: 2, locked: [false, true, false], limit_n: 3 });
    bench.operating.operate("demo", "Ada", DEVICE);
    bench.tell({ type: "open" }, text(grantText()));
    expect(bench.hand.told.find(({ type }) => type === "begin")).toMatchObject({ device: { motion: 2 } });
    expect(bench.hand.told).toContainEqual({ type: "lock", axes: [false, true, false] });
    expect(bench.hand.told).toContainEqual({ type: "limit", felt_n: 3 });
    bench.hand.forget();
    bench.operating.set({ motion: 2 });
    bench.operating.set({ limit_n: undefined });
    expect(bench.hand.told).toEqual([{ type: "limit", felt_n: undefined }]);
  });

  it("tells where the pointer is only while a tool is held", async () => {
    const bench = await Bench.held();
    bench.operating.hold();
    bench.operating.tell(1_000_001, [0.01, 0, 0]);
    expect(bench.hand.orders).toEqual(["hold", "sample"]);
    bench.tell(text({ type: "farewell", reason: "handed over to Bob" }));
    bench.hand.forget();
    bench.operating.hold();
    bench.operating.tell(1_000_002, [0.02, 0, 0]);
    expect(bench.hand.orders).toEqual([]);
    expect(bench.operating.standing.value).toMatchObject({ because: { kind: "farewell", reason: "handed over to Bob" } });
  });

  it("says why the hand was let go of until it takes hold anew", async () => {
    const bench = await Bench.held();
    bench.operating.hold();
    bench.tell({ type: "limited", felt_n: 2.5 });
    expect([bench.operating.letGo.value, bench.letGo]).toEqual([{ kind: "limit", felt_n: 2.5 }, 1]);
    bench.operating.hold();
    expect(bench.operating.letGo.value).toBeUndefined();
    bench.tell(stateOf(fakeHandState({ counts: fakeCounts({ gaps: 1 }) })));
    expect([bench.operating.letGo.value, bench.letGo]).toEqual([{ kind: "gap" }, 2]);
    bench.operating.hold();
    bench.tell(stateOf(fakeHandState({ counts: fakeCounts({ gaps: 1 }) })));
    expect(bench.operating.letGo.value).toBeUndefined();
    bench.operating.letGoFor({ kind: "hidden" });
    bench.tell(stateOf(fakeHandState({ counts: fakeCounts({ gaps: 2 }) })));
    expect(bench.operating.letGo.value).toEqual({ kind: "hidden" });
  });

  it("counts the worker's ticks over a second, and says that a limiter acts for as long after", async () => {
    const bench = await Bench.held();
    await bench.states(2000, () => fakeHandState());
    expect(bench.operating.hand.value?.rate_hz).toBeCloseTo(1000, -1);
    await bench.states(500, () => fakeHandState({ counts: fakeCounts({ guarded: 3 }) }));
    expect(bench.operating.hand.value?.isGuarded).toBe(true);
    await bench.states(1100, () => fakeHandState({ counts: fakeCounts({ guarded: 3 }) }));
    expect(bench.operating.hand.value?.isGuarded).toBe(false);
  });

  it("ends a loop that the server took its lease from and nobody came back to, and still says why", async () => {
    const bench = await Bench.held();
    bench.tell(text({ type: "farewell", reason: "stopped by Bob" }));
    await bench.platform.pass(59_000);
    expect(bench.hand.hasEnded).toBe(false);
    await bench.platform.pass(1000);
    expect(bench.hand.hasEnded).toBe(true);
    expect(bench.operating.standing.value).toMatchObject({ name: "out", because: { reason: "stopped by Bob" } });
    bench.operating.operate("demo", "Ada", DEVICE);
    expect(bench.hands).toHaveLength(2);
  });

  it("goes on with the same worker within that time, in the same session alone", async () => {
    for (const [session, workers] of [["demo", 1], ["other", 2]] as const) {
      const bench = await Bench.held();
      bench.tell(text({ type: "farewell", reason: "stopped by Bob" }));
      bench.operating.operate(session, "Ada", DEVICE);
      expect(bench.hands).toHaveLength(workers);
      expect(bench.hands[0].hasEnded).toBe(workers === 2);
      expect(bench.hand.sockets.at(-1)).toBe(session);
    }
  });

  it("gives the tool back when the page shows another session", async () => {
    const bench = await Bench.held();
    bench.operating.leaveUnless("demo");
    expect(bench.operating.standing.value.name).toBe("in");
    bench.operating.leaveUnless("other");
    expect(bench.operating.standing.value.name).toBe("leaving");
    expect(bench.hand.orders).toEqual(["leave"]);
  });

  it("says that a loop begins anew, whose handle is at home, and has somebody take hold of that one", async () => {
    const bench = await Bench.held();
    bench.operating.hold();
    bench.tell({ type: "closed", code: 1006, reason: "" }, { type: "open" }, text(grantText({ lease: 2 })));
    bench.operating.hold();
    bench.letGo = 0;
    bench.tell({ type: "refused", of: "renew", says: "another loop" }, stateOf(fakeHandState({ mode: "resting" })));
    expect(bench.hand.orders.slice(-5)).toEqual(["begin", "lock", "limit", "motion", "release"]);
    expect([bench.operating.letGo.value, bench.letGo]).toEqual([{ kind: "anew" }, 1]);
  });

  it("does not call a line full that was not there", async () => {
    const bench = await Bench.held();
    const unsent = (count: number): void => bench.tell(stateOf(fakeHandState(), count));
    unsent(3);
    bench.tell(text({ type: "farewell", reason: "stopped" }));
    unsent(500);
    bench.operating.operate("demo", "Ada", DEVICE);
    unsent(900);
    bench.tell({ type: "open" }, text(grantText({ lease: 2 })));
    unsent(910);
    expect(bench.operating.hand.value?.isUnsent).toBe(false);
    unsent(911);
    expect(bench.operating.hand.value?.isUnsent).toBe(true);
  });
});
