import { describe, expect, it } from "vitest";
import { builtHand, bytesOf, recordedStroke } from "../protocol/built_hand";
import type { HandModule } from "../protocol/hand_module";
import { HandLoop } from "./loop";
import type { FromHand, Pace, ToHand } from "./port";

const MOST_AT_ONCE = 100;

/** A worker whose clock a test moves. */
class Bench {
  now_ms = 5;
  waiting = 0;
  isBroken = false;
  readonly posted: FromHand[] = [];
  readonly sent: (string | Uint8Array)[] = [];
  closed = 0;
  readonly ticks: number[] = [];
  readonly loop: HandLoop;

  constructor(module: HandModule, how: Pace["how"]) {
    const advance = module.advance.bind(module);
    module.advance = (now_ms) => {
      if (this.isBroken) throw new WebAssembly.RuntimeError("unreachable");
      const ticks = advance(now_ms);
      this.ticks.push(ticks);
      return ticks;
    };
    this.loop = new HandLoop(module, {
      now: () => this.now_ms,
      began_epoch_ms: 1_000_000,
      how,
      connect: () => ({
        send: (message) => this.sent.push(message),
        waiting: () => this.waiting,
        close: () => { this.closed += 1; },
      }),
      post: (message) => this.posted.push(message),
    });
  }

  static async begun(how: Pace["how"] = "timers"): Promise<Bench> {
    const bench = new Bench(await builtHand(), how);
    const { keys, granted } = recordedStroke();
    bench.take({ type: "connect", url: "wss://lab/stream", subprotocols: ["teleclay.v1"] });
    bench.take({ type: "begin", keys: bytesOf(keys).buffer, granted, device: { rate_hz: 60, motion: 1 } });
    expect(bench.posted).toEqual([]);
    return bench;
  }

  take(message: ToHand): void {
    this.loop.take(message);
  }

  states(): Extract<FromHand, { type: "state" }>[] {
    return this.posted.filter((message) => message.type === "state");
  }

  /** Wakes after waits of the worker's choice as a platform keeps them, until so much time has passed. */
  run(span_ms: number, kept: (wait_ms: number, wake: number) => number): void {
    const end_ms = this.now_ms + span_ms;
    for (let wake = 0; this.now_ms < end_ms; wake++) {
      const wait_ms = this.loop.wake();
      if (wait_ms === undefined) return;
      this.now_ms += kept(wait_ms, wake);
    }
    this.loop.wake();
  }
}

describe("the hand's loop", () => {
  const platforms: [string, number, Pace["how"], (wait_ms: number, wake: number) => number][] = [
    ["exact sleeps", 2, "precise", (wait_ms) => Math.max(wait_ms, 0.05)],
    ["timers clamped to 4 ms", 4, "timers", (wait_ms) => Math.max(4, Math.ceil(wait_ms))],
    ["stalls of 300 ms", 300, "timers", (_, wake) => (wake % 10 === 9 ? 300 : 4)],
    ["a hidden tab at 1 Hz", 1000, "timers", () => 1000],
  ];
  it.each(platforms)("under %s makes a tick of every millisecond or gives it up, and never more than some at once", async (_, most_ms, how, kept) => {
    const bench = await Bench.begun(how);
    bench.run(20_000, kept);
    // A wake after which the page is told.
    bench.now_ms += 17;
    bench.loop.wake();
    const counts = bench.states().at(-1)?.state.counts;
    const passed = Math.floor(Math.trunc(bench.now_ms * 1e6) / 1e6) - 5;
    expect((counts?.ticks ?? 0) + (counts?.given_up ?? 0)).toBe(passed);
    expect(counts?.ticks).toBe(bench.ticks.reduce((sum, ticks) => sum + ticks, 0));
    expect(Math.max(...bench.ticks)).toBeLessThanOrEqual(MOST_AT_ONCE);
    // Only who sleeps for longer than is made up for gives ticks up.
    expect(0 < (counts?.given_up ?? 0)).toBe(most_ms > MOST_AT_ONCE);
    expect(counts?.gaps).toBe(most_ms < 500 ? 0 : 20);
  });

  it("sleeps for two ticks where it can, and for four where it cannot", async () => {
    for (const [how, wakes] of [["precise", 500], ["timers", 250]] as const) {
      const bench = await Bench.begun(how);
      bench.run(1000, (wait_ms) => Math.max(wait_ms, 0.01));
      expect(bench.ticks.length).toBeGreaterThan(wakes * 0.9);
      expect(bench.ticks.length).toBeLessThan(wakes * 1.1);
      expect(bench.sent.length).toBeLessThanOrEqual(bench.ticks.length);
    }
  });

  it("tells the page sixty times a second, and the most ticks of a wake since", async () => {
    const bench = await Bench.begun();
    bench.run(1000, () => 4);
    expect(bench.states().length).toBeGreaterThan(45);
    expect(bench.states().length).toBeLessThanOrEqual(61);
    bench.now_ms += 50;
    bench.loop.wake();
    expect(bench.states().at(-1)?.pace).toEqual({ how: "timers", most_ticks: 50, unsent: 0 });
  });

  it("goes on by itself while the page tells nothing, and lets go of the handle meanwhile", async () => {
    const bench = await Bench.begun();
    bench.take({ type: "hold" });
    const told = (span_ms: number, isTold: boolean): void => bench.run(span_ms, () => {
      if (isTold) bench.take({ type: "sample", at_epoch_ms: 1_000_000 + bench.now_ms, position_m: [0.01, 0, 0] });
      return 4;
    });
    told(200, true);
    expect(bench.states().at(-1)?.state.grasp).toBe("held");
    told(300, false);
    expect(bench.states().at(-1)?.state).toMatchObject({ grasp: "waiting", hand_force_n: [0, 0, 0] });
    told(200, true);
    expect(bench.states().at(-1)?.state.grasp).toBe("held");
    expect(bench.states().at(-1)?.state.counts).toMatchObject({ given_up: 0, gaps: 0 });
  });

  it("does not queue frames in a socket that is full, and sends none without one", async () => {
    const bench = await Bench.begun();
    bench.run(100, () => 4);
    const before = bench.sent.length;
    bench.waiting = 1 << 20;
    bench.run(100, () => 4);
    expect(bench.sent.length).toBe(before);
    bench.loop.onClose(1006, "");
    bench.run(100, () => 4);
    expect(bench.sent.length).toBe(before);
    expect(bench.states().at(-1)?.pace.unsent).toBeGreaterThan(40);
    expect(bench.states().at(-1)?.state).toMatchObject({ wanted: { lease: true } });
    expect(bench.posted).toContainEqual({ type: "closed", code: 1006, reason: "" });
  });

  it("hears frames itself and hands everything else through", async () => {
    const bench = await Bench.begun();
    const wake = recordedStroke().wakes.find(({ heard }) => 0 < heard.length);
    bench.loop.onBinary(bytesOf(wake?.heard[0] ?? "").buffer);
    bench.run(8, () => 4);
    bench.loop.onBinary(Uint8Array.from([0x54, 0x43, 1, 4, 9]).buffer);
    bench.run(20, () => 4);
    const bricks = Uint8Array.from([0x54, 0x43, 1, 2]).buffer;
    bench.loop.onBinary(bricks);
    bench.loop.onText("hello");
    expect(bench.posted.filter(({ type }) => type !== "state")).toEqual([{ type: "binary", bytes: bricks }, { type: "text", text: "hello" }]);
    expect(bench.states().at(-1)?.state.counts).toMatchObject({ unheard: 0, undecodable: 1 });
    expect(bench.states().at(-1)?.state.link).not.toBe("not_yet");
    bench.take({ type: "text", text: "ping" });
    expect(bench.sent.at(-1)).toBe("ping");
  });

  it("says what is refused and goes on; where the module breaks it ends, and the server learns it", async () => {
    const bench = await Bench.begun();
    bench.take({ type: "motion", motion: -1 });
    bench.take({ type: "parameters", json: "[]" });
    expect(bench.posted).toMatchObject([{ type: "refused", of: "motion" }, { type: "refused", of: "parameters" }]);
    bench.run(40, () => 4);
    bench.isBroken = true;
    expect(bench.loop.wake()).toBeUndefined();
    expect(bench.closed).toBe(1);
    expect(bench.posted.at(-1)).toEqual({ type: "trouble", says: "the hand has ended, as its module broke: unreachable" });
    const [wakes, posted] = [bench.ticks.length, bench.posted.length];
    bench.take({ type: "hold" });
    bench.loop.wake();
    expect([bench.ticks.length, bench.posted.length]).toEqual([wakes, posted]);
  });

  it("lets go where so much is felt as the hand said is enough, and the page need not be awake for it", async () => {
    const felt = async (limit_n: number | undefined): Promise<{ most_n: number; let_go_n: number[]; grasps: Set<string> }> => {
      const bench = await Bench.begun();
      bench.take({ type: "limit", felt_n: limit_n });
      let [most_n, isHeld] = [0, false];
      const { wakes } = recordedStroke();
      for (const { now_ms, samples, heard } of wakes) {
        bench.now_ms = now_ms;
        for (const message of heard) bench.loop.onBinary(bytesOf(message).buffer);
        for (const [at_ms, x_m, y_m, z_m] of samples) bench.take({ type: "sample", at_epoch_ms: 1_000_000 + at_ms, position_m: [x_m, y_m, z_m] });
        if (!isHeld) bench.take({ type: "hold" });
        isHeld = true;
        bench.loop.wake();
        most_n = Math.max(most_n, Math.hypot(...(bench.states().at(-1)?.state.felt_force_n ?? [0])));
      }
      const let_go_n = bench.posted.flatMap((message) => (message.type === "limited" ? [message.felt_n] : []));
      return { most_n, let_go_n, grasps: new Set(bench.states().map(({ state }) => state.grasp)) };
    };
    const free = await felt(undefined);
    expect(free.let_go_n).toEqual([]);
    expect(free.most_n).toBeGreaterThan(0.2);
    const limited = await felt(free.most_n / 2);
    expect(limited.let_go_n).toHaveLength(1);
    expect(limited.let_go_n[0]).toBeGreaterThanOrEqual(free.most_n / 2);
    expect(limited.grasps).toContain("released");
    expect((await felt(free.most_n * 1.01)).let_go_n).toEqual([]);
  });

  it("without its line lets the force fade and sends nothing, until there is another", async () => {
    const bench = await Bench.begun();
    bench.run(40, () => 4);
    bench.take({ type: "disconnect" });
    const before = bench.sent.length;
    bench.run(100, () => 4);
    expect([bench.closed, bench.sent.length]).toEqual([1, before]);
    expect(bench.states().at(-1)?.state).toMatchObject({ felt_force_n: [0, 0, 0], wanted: { lease: true } });
    bench.take({ type: "connect", url: "wss://lab/stream", subprotocols: ["teleclay.v1"] });
    bench.run(40, () => 4);
    expect(bench.sent.length).toBeGreaterThan(before);
  });
});
