// The Robot page against the real server and a real handle: the arms move with the hand, and every angle is the
// server's.

import { beforeAll, describe, expect, it } from "vitest";
import { decodeInverseAnswer, decodeJacobianAnswer } from "../src/protocol/text";
import type { Branch, RobotGeometry, Triple } from "../src/protocol/theory";
import { benchAt, expectNear, numberIn } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

/** The desktop robot, typed off the paper's defaults and not taken from the page. */
const DESKTOP: RobotGeometry = {
  base_radius_m: 0.12, platform_radius_m: 0.04, upper_link_m: 0.1, lower_link_m: 0.2, arm_angles_deg: [0, 120, 240],
};
/** Off the middle, so that every arm has another angle. */
const PLACE_MM = [20, -15, 150] as const;
/** One place after the point is shown. */
const SHOWN_DEG = 0.051;
/** Share of the picture that an arm moves. */
const SEEN = 0.002;

const opened = benchAt("#/robot?picture=plain", []);
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(() => {
  ({ teleclay, page } = opened());
});

describe("the Robot page", () => {
  it("moves its arms with the live handle", async () => {
    await until("the hand moves", async () => (await teleclay.session()).state === "running");
    const before = { picture: await robot(), angle: await angle(1) };
    await until("the first joint turns", async () => 0.5 < Math.abs((await angle(1)) - before.angle));
    await until("the picture moves", async () => SEEN < (await page.share(before.picture, await robot())));
  });

  it("has every joint angle of all eight branches from the server, at a place set by hand", async () => {
    await page.choose("source", "hand");
    await putAt(PLACE_MM);
    const { branches } = decodeInverseAnswer(await teleclay.ask("kinematics/inverse", { geometry: DESKTOP, position_m: metres(PLACE_MM) }));
    expect(branches.length).toBe(8);
    await until("the page has the answer", async () => {
      const rows = await tabled();
      return branches.every(({ branch, joints_rad }) =>
        rows.get(signs(branch))?.every((shown, j) => Math.abs(shown - degrees(joints_rad[j])) < SHOWN_DEG));
    });
    expect((await tabled()).size).toBe(8);
  });

  it("draws the branch that is chosen, and says how far it is from singular", async () => {
    for (const branch of [[1, 1, 1], [-1, 1, -1], [-1, -1, -1]] as const) {
      const before = await robot();
      const question = { geometry: DESKTOP, position_m: metres(PLACE_MM) };
      const { branches } = decodeInverseAnswer(await teleclay.ask("kinematics/inverse", question));
      const { condition_number, parallel_measure } = decodeJacobianAnswer(await teleclay.ask("kinematics/jacobian", { ...question, branch }));
      const want = branches.find((each) => signs(each.branch) === signs(branch))?.joints_rad ?? [];
      await page.page.locator(`input[name=branch][value="${signs(branch)}"]`).check();
      await until(`the drawn joints are those of ${signs(branch)}`, async () => {
        const drawn = await Promise.all([1, 2, 3].map(angle));
        return drawn.every((shown, j) => Math.abs(shown - degrees(want[j])) < SHOWN_DEG);
      });
      await until("the picture shows it", async () => SEEN < (await page.share(before, await robot())));
      await until("the condition is this one's", async () =>
        Math.abs(numberIn(await page.text("condition")) - condition_number) < 0.006 * condition_number);
      expectNear("det K_r", numberIn(await page.text("parallel")), parallel_measure, 0.006);
    }
  });

  it("says which arms are too short for a place beyond its reach", async () => {
    await page.set("position-x", "200");
    await page.saying("posture", /Out of reach: arm/);
    const named = [...(await page.text("posture")).matchAll(/arm (\d)/g)].map(([, arm]) => Number(arm));
    expect(named.length).toBeGreaterThan(0);
    await until("the same arms are drawn as too short", async () => {
      const drawn = await Promise.all([1, 2, 3].map((arm) => page.text(`joint-${arm}`)));
      return [1, 2, 3].every((arm) => drawn[arm - 1].includes("too short") === named.includes(arm));
    });
    // The server thinks so, too, though the page does not trouble it.
    await expect(teleclay.ask("kinematics/inverse", { geometry: DESKTOP, position_m: [0.2, -0.015, 0.15] })).rejects.toThrow("422");
    await page.keep("robot-short");
    await putAt(PLACE_MM);
    await page.saying("posture", /singular/i);
  });

  it("maps the workspace of another robot, too", async () => {
    const before = await page.saying("reach", "dm³");
    await page.set("lower_link_m", "240");
    await until("the workspace is larger", async () => numberIn(before) < numberIn(await page.text("reach")));
    await page.set("lower_link_m", "200");
    await until("the workspace is the first again", async () => (await page.text("reach")) === before);
  });

  it("goes back to the live handle", async () => {
    await page.choose("source", "live");
    const before = await angle(2);
    await until("the arms move again", async () => (await angle(2)) !== before);
  });

  it("fits desk and telephone, light and dark", async () => {
    expect(await page.fit("robot")).toEqual([]);
  });

  it("gives the browser nothing to complain about", () => {
    expect(page.complaints).toEqual([]);
  });
});

async function angle(arm: number): Promise<number> {
  return numberIn(await page.text(`joint-${arm}`));
}

async function putAt(place_mm: readonly number[]): Promise<void> {
  for (const [axis, name] of ["x", "y", "z"].entries()) await page.set(`position-${name}`, String(place_mm[axis]));
}

/** The table of branches: angles in degrees by signs. */
async function tabled(): Promise<Map<string, number[]>> {
  const rows = await page.page.getByTestId("branches").locator("tr").all();
  return new Map(await Promise.all(rows.map(async (row) =>
    [(await row.locator("th").innerText()).trim(), (await row.locator("td").allInnerTexts()).map(numberIn)] as const)));
}

function robot(): Promise<Buffer> {
  return page.page.getByTestId("robot").screenshot({ style: ".picture > :not(canvas) { visibility: hidden }" });
}

function signs(branch: Branch): string {
  return branch.map((sign) => (sign === 1 ? "+" : "−")).join(" ");
}

function metres([x, y, z]: readonly [number, number, number]): Triple {
  return [x / 1000, y / 1000, z / 1000];
}

function degrees(radians: number): number {
  return (radians * 180) / Math.PI;
}
