// The Stability page against the real server: what it says is what /analysis/loop says, and what it draws can be
// measured.

import { beforeAll, describe, expect, it } from "vitest";
import { decodeLoopAnswer } from "../src/protocol/text";
import type { LoopAnswer, LoopRequest } from "../src/protocol/theory";
import { benchAt, expectNear, numberIn } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/**
 * The paper's x axis with its gains, (35) and (37), typed off the paper and not taken from the page; clay of 20 N·s/m.
 */
const PAPER: LoopRequest = {
  g_h: { numerator: [18, 1], denominator: [0.005, 0.4, 18, 1] },
  t_h: [0.25, 2, 6],
  c_h1: { numerator: [1], denominator: [1, 10, 0] },
  g_t: { numerator: [1], denominator: [0.5, 20, 0] },
  position_ratio: 1,
  force_ratio: -1,
  clay_damping_n_s_per_m: 20,
  clay_stiffness_n_per_m: 0,
};
/** Three digits are shown. */
const SHOWN = 0.006;

const opened = benchAt("#/stability?picture=plain", "nobody");
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(() => {
  ({ teleclay, page } = opened());
});

describe("the Stability page", () => {
  it("says of the paper's gains what the server's analysis says", async () => {
    const answer = await analyse(PAPER);
    await agreeWith(answer);
    expect(answer.delay_verdict_position_force).toBe("finite");
    expect(answer.delay_verdict_force_exchange).toBe("unbounded");
    expect(await page.text("verdict")).toContain("force exchange is stable at every delay");
  });

  it("changes its mind where the margin is, on either side of it", async () => {
    const margin_ms = 1000 * ((await analyse(PAPER)).delay_margin_position_force_s ?? Number.NaN);
    await page.set("round_trip_s", (0.98 * margin_ms).toFixed(2));
    await page.saying("verdict", /position–force is within its margin/);
    expect(await page.page.locator(".sentence").getAttribute("data-calm")).toBe("true");
    await page.set("round_trip_s", (1.02 * margin_ms).toFixed(2));
    await page.saying("verdict", /position–force is past its margin.*oscillates/s);
    expect(await page.page.locator(".sentence").getAttribute("data-calm")).toBe("false");
  });

  it("follows a slider's field to the server and back", async () => {
    await page.set("clay_damping_n_s_per_m", "60");
    await page.set("mass_kg", "2");
    await agreeWith(await analyse({
      ...PAPER, c_h1: { numerator: [1], denominator: [2, 10, 0] }, clay_damping_n_s_per_m: 60,
    }));
  });

  it("shows an unstable loop as one", async () => {
    await page.page.getByRole("button", { name: "light handle" }).click();
    const answer = await analyse({ ...PAPER, c_h1: { numerator: [1], denominator: [0.2, 5, 0] }, clay_damping_n_s_per_m: 60 });
    expect(answer.stable_without_delay).toBe(false);
    expect(Math.max(...answer.closed_loop_poles.map(([re]) => re))).toBeGreaterThan(0);
    await page.saying("verdict", "Even without delay the loop is unstable");
    await agreeWith(answer);
    expect(await page.page.locator(".sentence").getAttribute("data-calm")).toBe("false");
    expect(await page.page.getByTestId("margin-position_force").getAttribute("data-grade")).toBe("bad");
    await page.keep("stability-unstable");
  });

  it("has a finite margin of force exchange, too, where the server has one", async () => {
    await page.page.getByRole("button", { name: "sprung handle" }).click();
    const answer = await analyse({
      ...PAPER,
      g_h: { numerator: [8, 1], denominator: [0.002, 0.17, 8, 1] },
      c_h1: { numerator: [1], denominator: [0.02, 0.4, 2] },
      clay_stiffness_n_per_m: 10,
    });
    expect(answer.delay_verdict_force_exchange).toBe("finite");
    await agreeWith(answer);
    await page.page.getByRole("button", { name: "paper" }).click();
    await agreeWith(await analyse(PAPER));
  });

  it("draws Nyquist with equal axes, -1 marked, the curve where the server has it", async () => {
    await page.choose("loop", "open");
    let unitBefore_px = 0;
    for (const zoom of ["near", "mid", "far"]) {
      await page.choose("zoom", zoom);
      // The figure is drawn in the frame after the choice: until then it is the one before, or none.
      await until(`-1 is marked at zoom ${zoom}`, async () => {
        const { unit_px, zero_px } = await page.figure("nyquist");
        if (unit_px.x === unitBefore_px) return false;
        const about = { x: zero_px.x - unit_px.x, y: zero_px.y, radius: 8 };
        return 10 < (await page.inkedAt("nyquist", "--bad", about));
      });
      const { unit_px } = await page.figure("nyquist");
      // One unit is as long on either axis, in pixels that can be counted.
      expect(unit_px.x).toBeCloseTo(unit_px.y, 6);
      unitBefore_px = unit_px.x;
    }
    await page.choose("zoom", "near");
    const { nyquist: { re, im } } = await analyse(PAPER);
    const { unit_px, zero_px } = await until("the figure is near again", async () => {
      const figure = await page.figure("nyquist");
      const about = { x: figure.zero_px.x - figure.unit_px.x, y: figure.zero_px.y, radius: 8 };
      const isDrawn = 10 < (await page.inkedAt("nyquist", "--bad", about));
      return figure.unit_px.x !== unitBefore_px && isDrawn ? figure : false;
    });
    let seen = 0;
    for (const [n, real] of re.entries()) {
      if (1 < Math.hypot(real, im[n]) || n % 8 !== 0) continue;
      const [x, y] = [zero_px.x + unit_px.x * real, zero_px.y - unit_px.y * im[n]];
      expect(await page.inkedAt("nyquist", "--accent", { x, y, radius: 3 }), `the curve passes ${real}, ${im[n]}`).toBeGreaterThan(0);
      seen += 1;
    }
    expect(seen).toBeGreaterThan(3);
    await page.choose("loop", "position_force");
    await until("the other loop's curve is drawn", async () => 100 < (await page.inked("nyquist", "--tool")));
  });

  it("reads Bode under the mouse, and shows the same frequency in Nyquist", async () => {
    await page.choose("loop", "open");
    // Looked at without a screenshot: that would scroll, and take the mouse off.
    const before = await page.inked("nyquist", "--text");
    await page.page.getByTestId("bode-magnitude").hover();
    await until("the frequency is marked in Nyquist", async () => before < (await page.inked("nyquist", "--text")));
    await page.page.mouse.move(2, 2);
  });

  it("reads Bode by keys, in words for who does not see it", async () => {
    const before = await page.inked("nyquist", "--text");
    await page.page.getByTestId("bode-curves").focus();
    for (const key of ["Home", "PageDown", "PageDown"]) await page.page.keyboard.press(key);
    const { nyquist: { omega_rad_s, re, im } } = await analyse(PAPER);
    const wanted = 100 * Math.max(omega_rad_s[0], 1e-2);
    const away = (n: number): number => Math.abs(Math.log(omega_rad_s[n] / wanted));
    const nearest = omega_rad_s.reduce((best, _, n) => (away(n) < away(best) ? n : best), 0);
    const magnitude_db = 20 * Math.log10(Math.hypot(re[nearest], im[nearest]));
    await until("the cursor is two decades above the lowest frequency", async () => (await page.text("bode-reading")).startsWith(`${omega_rad_s[nearest].toPrecision(2)} rad/s`));
    expect(await page.text("bode-reading")).toContain(`${magnitude_db.toFixed(1)} dB`);
    await until("the frequency is marked in Nyquist", async () => before < (await page.inked("nyquist", "--text")));
    await page.page.keyboard.press("Escape");
    await until("the mark has gone", async () => (await page.inked("nyquist", "--text")) <= before);
  });

  it("fits desk and telephone, light and dark", async () => {
    expect(await page.fit("stability")).toEqual([]);
  });

  it("gives the browser nothing to complain about", () => {
    expect(page.complaints).toEqual([]);
  });
});

async function analyse(request: LoopRequest): Promise<LoopAnswer> {
  return decodeLoopAnswer(await teleclay.ask("analysis/loop", request));
}

/** Waits until the page shows the answer's poles, then holds everything else it shows against the answer. */
async function agreeWith(answer: LoopAnswer): Promise<void> {
  const rightmost = Math.max(...answer.closed_loop_poles.map(([re]) => re));
  await until("the page has this answer", async () =>
    (await page.page.locator(".stability").getAttribute("data-asked")) === "answered" &&
    (await page.page.getByTestId("slowest-pole").count()) === 1 && near(numberIn(await value("slowest-pole")), rightmost));
  for (const scheme of ["position_force", "force_exchange"] as const) {
    const verdict = answer[`delay_verdict_${scheme}`];
    const shown = await value(`margin-${scheme}`);
    if (verdict === "finite") expectNear(`margin of ${scheme}, ms`, numberIn(shown), 1000 * (answer[`delay_margin_${scheme}_s`] ?? Number.NaN), SHOWN);
    else expect(shown).toBe(verdict === "unbounded" ? "∞" : "–");
  }
  if (answer.phase_margin !== null) {
    // One place after the point is shown.
    expect(numberIn(await value("phase-margin"))).toBeCloseTo((answer.phase_margin.phase_rad * 180) / Math.PI, 1);
  }
  const gains = [answer.gain_margin_increase, answer.gain_margin_decrease].filter((gain) => gain !== null).map(({ factor }) => factor);
  const shown = [...(await value("gain-margin")).matchAll(/×([^,]+)/g)].map(([, text]) => numberIn(text));
  expect(shown.length).toBe(gains.length);
  shown.forEach((factor, n) => expectNear("gain margin", factor, gains[n], SHOWN));
  if (answer.nyquist_min_distance !== null) expect(numberIn(await value("exact"))).toBeCloseTo(answer.nyquist_min_distance, 3);
  if (answer.small_gain_peak !== null) expectNear("(34)", numberIn(await value("sufficient")), answer.small_gain_peak, SHOWN);
  expect(await page.page.getByTestId("sufficient").getAttribute("data-grade")).toBe(answer.small_gain_holds ? "good" : "plain");
}

function value(row: string): Promise<string> {
  return page.page.getByTestId(row).locator(".value").innerText();
}

function near(got: number, want: number): boolean {
  return Math.abs(got - want) <= SHOWN * Math.abs(want);
}
