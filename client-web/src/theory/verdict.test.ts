import { beforeAll, describe, expect, it } from "vitest";
import { builtMathematics } from "../protocol/built_module";
import { type DelayedLoop, loopOf, type LoopParts } from "./loop";
import { verdictOf } from "./verdict";

/** The paper's handle along x with clay of 20 N·s/m; its margins are those of the reference's second loop. */
const PARTS: LoopParts = {
  g_h: { numerator: [18, 1], denominator: [0.005, 0.4, 18, 1] },
  c_h1: { numerator: [1], denominator: [1, 10, 0] },
  t_h: [0.25, 2, 6],
  position_ratio: 1, force_ratio: -1, clay_damping_n_s_per_m: 20, clay_stiffness_n_per_m: 0,
};
const MARGINS = {
  stable_without_delay: true,
  delay_margin_force_exchange_s: null, delay_verdict_force_exchange: "unbounded",
  delay_margin_position_force_s: 0.14658, delay_verdict_position_force: "finite",
} as const;

let delayed: (parts: LoopParts) => DelayedLoop;
beforeAll(async () => {
  const module = await builtMathematics();
  delayed = (parts) => loopOf(module, parts) ?? expect.fail("this is no loop");
});

describe("the plain sentence", () => {
  it("says what happens past a margin: how fast it swings, that it grows, and who is spared", () => {
    const { headline, schemes: [position, force] } = verdictOf(MARGINS, delayed(PARTS), 0.2);
    expect(headline).toMatch(/^At 200 ms position–force is past its margin of 147 ms: the loop oscillates at \d(\.\d+)? Hz and grows, twice as wide every .+; force exchange is stable at every delay\.$/);
    expect(position.isStable).toBe(false);
    // Just past the margin the swing is where the gain is 1.
    expect(position.growth?.frequency_hz).toBeGreaterThan(1);
    expect(position.growth?.frequency_hz).toBeLessThan(5);
    expect(force.isStable).toBe(true);
    expect(force.peakGain).toBeLessThan(1);
    expect(force.because).toContain("below 1");
    expect(force.because).toContain("drift apart");
  });

  it("says that it settles within one, and why there is a margin at all", () => {
    const { headline, schemes: [position] } = verdictOf(MARGINS, delayed(PARTS), 0.05);
    expect(headline).toBe("At 50 ms position–force is within its margin of 147 ms and settles; force exchange is stable at every delay.");
    expect(position.growth).toBeUndefined();
    expect(position.peakGain).toBeGreaterThan(1);
  });

  it("says so when there is nothing to keep", () => {
    const loop = delayed({ ...PARTS, c_h1: { numerator: [1], denominator: [0.2, 5, 0] }, clay_damping_n_s_per_m: 60 });
    const { headline, schemes } = verdictOf({
      stable_without_delay: false,
      delay_margin_force_exchange_s: null, delay_verdict_force_exchange: "unstable_without_delay",
      delay_margin_position_force_s: null, delay_verdict_position_force: "unstable_without_delay",
    }, loop, 0.02);
    expect(headline).toMatch(/^Even without delay the loop is unstable: the loop oscillates at \d+ Hz and grows, twice as wide every \d+ ms\.$/);
    expect(schemes.every(({ isStable }) => !isStable)).toBe(true);
  });
});
