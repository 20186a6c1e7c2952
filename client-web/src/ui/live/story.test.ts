import { beforeEach, describe, expect, it } from "vitest";
import type { Session } from "../../protocol/session";
import { CHANNELS, Channel } from "../../protocol/telemetry";
import { fakeSession } from "../../state/fake_session";
import { History } from "../../state/history";
import { changesBackTo, changesFor, outcomes, stepOf, STEPS, StoryWatch } from "./story_model";
import { swingOf } from "./unrest";

const STEP_S = 0.005;

/** A vector whose x is as given, over so many seconds. */
function series(seconds: number, x: (t: number) => number): number[] {
  return Array.from({ length: seconds / STEP_S }, (_, n) => [x(n * STEP_S), 0, 0]).flat();
}

/** A session with the changes that a step asks for. */
function sessionAt(step: (typeof STEPS)[number]): Session {
  const changes = changesFor(step);
  const session = fakeSession();
  const impairment = { ...session.network.up, delay_s: changes["/network/up/delay_s"] ?? 0 };
  return {
    ...session,
    scheme: changes["/scheme"] ?? session.scheme,
    material: { ...session.material, viscosity_pa_s_per_m: changes["/material/viscosity_pa_s_per_m"] ?? 0 },
    network: { up: impairment, down: impairment },
  };
}

describe("unrest", () => {
  it("is the root mean square of a swing, whatever it swings about", () => {
    // 5 Hz: two whole swings to a window.
    expect(swingOf(series(4, (t) => 2 + 0.3 * Math.sin(2 * Math.PI * 5 * t)), STEP_S)).toBeCloseTo(0.3 / Math.SQRT2, 2);
  });

  it("does not count the few moments in which a stroke turns round", () => {
    expect(swingOf(series(6, (t) => (t % 3 < 1.5 ? 1 : -1)), STEP_S)).toBeCloseTo(0, 9);
  });

  it("says nothing of too little", () => {
    expect(swingOf(series(0.8, () => 1), STEP_S)).toBeUndefined();
  });
});

describe("the story", () => {
  beforeEach(() => {
    outcomes.value = {};
  });

  it("knows each step by the session alone, and none in the demo's own", () => {
    for (const step of STEPS) expect(stepOf(sessionAt(step))).toBe(step);
    expect(stepOf(fakeSession())).toBeUndefined();
    expect(stepOf({ ...sessionAt("late"), scheme: "wave" })).toBeUndefined();
  });

  it("can put back all that it changes", () => {
    const back = changesBackTo(fakeSession());
    for (const step of STEPS) expect(Object.keys(back).toSorted()).toEqual(Object.keys(changesFor(step)).toSorted());
  });

  it("measures a step once it has settled, and keeps it when the next one begins", () => {
    const history = new History();
    const watch = new StoryWatch();
    const feed = (from_s: number, to_s: number, force_n: (t: number) => number): void => {
      const values = new Float32Array((to_s - from_s) * 1000 * CHANNELS);
      for (let n = 0; n < (to_s - from_s) * 1000; n += 1) values[n * CHANNELS + Channel.felt_force_n] = force_n(from_s + n / 1000);
      history.append({ sequence: 0, tool: 1, period_us: 1000, dropped: 0, first_time_s: from_s, values });
    };
    watch.look(sessionAt("crisp"), history, 0);
    feed(0, 4, () => 1);
    watch.look(sessionAt("crisp"), history, 4);
    expect(outcomes.value).toEqual({});
    feed(4, 6, () => 1);
    watch.look(sessionAt("crisp"), history, 6);
    expect(outcomes.value.crisp?.felt_n).toBeCloseTo(0, 9);
    watch.look(sessionAt("late"), history, 6);
    feed(6, 14, (t) => 4 * Math.sin(2 * Math.PI * 5 * t));
    watch.look(sessionAt("late"), history, 14);
    expect(outcomes.value.late?.felt_n).toBeCloseTo(4 / Math.SQRT2, 1);
    expect(outcomes.value.crisp?.felt_n).toBeCloseTo(0, 9);
  });
});
