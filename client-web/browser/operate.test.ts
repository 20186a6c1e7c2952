// A person takes the tool in the browser: the page, its worker and its module, with a stand-in for the server.

import type { Browser } from "playwright-core";
import { afterAll, beforeAll, beforeEach, describe, expect, it } from "vitest";
import { StandIn } from "./stand_in";
import { until } from "./until";
import { launch, VIEWPORT, WatchedPage } from "./watched_page";

let standIn: StandIn;
let browser: Browser;
let ada: WatchedPage;

beforeAll(async () => {
  standIn = await StandIn.start();
  browser = await launch();
  ada = await WatchedPage.open(browser, `${standIn.url}/#/live?session=demo&picture=plain`);
});
beforeEach(({ onTestFailed }) => onTestFailed(() => {
  process.stderr.write(`${[...new Set(ada.complaints)].join("\n")}\n${JSON.stringify(standIn.asked.slice(-5))}\n`);
}));
afterAll(async () => {
  await browser.close();
  standIn.end();
});

const attribute = (id: string, name: string): Promise<string | null> => ada.page.getByTestId(id).getAttribute(name);
const grasp = (wanted: string): Promise<unknown> => until(`the hand is ${wanted}`, async () => (await attribute("scene", "data-grasp")) === wanted);
const standing = (wanted: string): Promise<unknown> => until(`the page is ${wanted}`, async () => (await attribute("operating", "data-standing")) === wanted);

function toolNow(): readonly number[] {
  if (standIn.tool_m === undefined) throw new Error("nobody holds the tool");
  return standIn.tool_m;
}

async function middle(): Promise<{ x: number; y: number }> {
  const box = await ada.page.getByTestId("scene").boundingBox();
  if (box === null) throw new Error("there is no picture");
  return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
}

describe("operating in the browser", () => {
  it("loads nothing of the hand before somebody operates", async () => {
    const loaded: string[] = [];
    ada.page.on("request", (request) => loaded.push(request.url()));
    await ada.saying("tool-1", "free");
    await ada.page.reload();
    await ada.saying("tool-1", "free");
    expect(loaded.some((url) => url.includes("/assets/index"))).toBe(true);
    expect(loaded.filter((url) => url.includes("hand"))).toEqual([]);
  });

  it("takes the tool under a name, runs the loop, and moves nothing by itself", async () => {
    await ada.page.getByTestId("operator").fill("Ada");
    await ada.page.getByTestId("operate").click();
    await standing("in");
    expect(standIn.asked[0]).toMatchObject({ type: "join", operator: "Ada", device: { axes: 2, force_n: 0, measures_force: false } });
    expect(standIn.tool.operator).toBe("Ada");
    await ada.saying("tool-1", "Ada, here");
    await until("the loop runs at its rate", async () => 900 < (await ada.number("loop-rate")) && (await ada.number("loop-rate")) < 1100);
    await until("frames come", () => 20 < standIn.frames);
    await grasp("released");
    expect(await ada.number("hand-force")).toBe(0);
  });

  it("holds while a drag lasts, takes the tool along under the pointer, and lets go with the button", async () => {
    const { x, y } = await middle();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await grasp("held");
    const before_m = toolNow();
    await ada.page.mouse.move(x + 60, y, { steps: 12 });
    await until("the tool has come along", () => 0.005 < toolNow()[0] - before_m[0]);
    await until("the spring is at rest", async () => (await ada.number("hand-force")) < 0.05);
    // To the right on the screen is along x, and a little towards who looks.
    const way_m = toolNow().map((part, axis) => part - before_m[axis]);
    expect(Math.abs(way_m[1])).toBeLessThan(way_m[0]);
    expect(way_m[2]).toBe(0);
    await ada.page.mouse.up();
    await grasp("released");
    await until("the force has faded", async () => (await ada.number("hand-force")) === 0);
    const let_go_m = toolNow();
    await ada.page.mouse.move(x, y, { steps: 6 });
    expect(await attribute("scene", "data-grasp")).toBe("released");
    expect(toolNow()[0]).toBeCloseTo(let_go_m[0], 3);
  });

  it("lifts by the wheel, for as long as that takes", async () => {
    const { x, y } = await middle();
    const before_m = toolNow()[2];
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.wheel(0, -200);
    await until("the tool is 4 mm higher", () => Math.abs(toolNow()[2] - before_m - 0.004) < 2e-4);
    await grasp("released");
    await until("the page says so", async () => Math.abs((await ada.number("tool-height")) - 1000 * toolNow()[2]) < 0.11);
  });

  it("moves by keys as long as space is down, and lets go where the focus goes", async () => {
    const before_m = toolNow()[0];
    await ada.page.getByTestId("operate").click();
    await ada.page.keyboard.down("ArrowRight");
    await ada.page.keyboard.down("Space");
    await grasp("held");
    await until("the tool goes along x", () => 0.005 < toolNow()[0] - before_m);
    await ada.page.keyboard.up("ArrowRight");
    await ada.page.keyboard.down("c");
    await grasp("clutched");
    await ada.page.keyboard.up("c");
    await grasp("held");
    await ada.page.getByTestId("latch").focus();
    await grasp("released");
    await ada.page.keyboard.up("Space");
  });

  it("moves by fingers: one drags, a second one lifts as they part", async () => {
    const { x, y } = await middle();
    const fingers = await ada.page.context().newCDPSession(ada.page);
    const touch = (type: "touchStart" | "touchMove" | "touchEnd", ...points: readonly (readonly [number, number])[]): Promise<unknown> =>
      fingers.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([px, py], id) => ({ x: px, y: py, id })) });
    const before_m = toolNow();
    await touch("touchStart", [x, y]);
    await grasp("held");
    for (let step = 1; step <= 10; step += 1) await touch("touchMove", [x - 5 * step, y]);
    await until("the tool has come along", () => toolNow()[0] - before_m[0] < -0.004);
    await touch("touchStart", [x - 50, y], [x + 50, y]);
    for (let step = 1; step <= 10; step += 1) await touch("touchMove", [x - 50, y], [x + 50 + 4 * step, y]);
    await until("the tool is 6 mm higher", () => Math.abs(toolNow()[2] - before_m[2] - 0.006) < 4e-4);
    await touch("touchEnd");
    await grasp("released");
  });

  it("moves by a gamepad's stick while its button is down, and rumbles by what is felt", async () => {
    await ada.page.evaluate(plugIn);
    const before_m = toolNow()[0];
    await ada.page.evaluate(() => Object.assign(window, { padButton: 1, padX: 0 }));
    await grasp("held");
    await ada.page.evaluate(() => Object.assign(window, { padX: 1 }));
    await until("the tool goes along x by no more than the stick", () => 0.03 < toolNow()[0] - before_m && toolNow()[0] - before_m < 0.045);
    await until("it has rumbled", () => ada.page.evaluate(() => 0 < Number(Reflect.get(window, "rumbles"))));
    await ada.page.evaluate(() => Object.assign(window, { padButton: 0, padX: 0 }));
    await grasp("released");
    await ada.page.evaluate(() => { Object.defineProperty(navigator, "getGamepads", { value: () => [], configurable: true }); });
  });

  it("lets go above the limit that is set, and where an axis is held fast it does not move along that", async () => {
    await ada.page.getByText("How the hand is set").click();
    await ada.set("hand-limit", "0.3");
    const { x, y } = await middle();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await grasp("held");
    await ada.page.mouse.move(x + 120, y, { steps: 6 });
    await ada.saying("operate-says", "More was felt than the limit");
    await grasp("released");
    await ada.page.mouse.up();
    await ada.set("hand-limit", "0");
    await ada.page.getByTestId("lock-x").check();
    const before_m = toolNow();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await grasp("held");
    await ada.page.mouse.move(x + 60, y - 60, { steps: 12 });
    await until("the tool goes along y", () => 0.004 < Math.abs(toolNow()[1] - before_m[1]));
    expect(Math.abs(toolNow()[0] - before_m[0])).toBeLessThan(1e-3);
    await ada.page.mouse.up();
    await ada.page.getByTestId("lock-x").uncheck();
    await ada.page.getByText("How the hand is set").click();
  });

  it("lets go where the page goes out of sight, and says so on return", async () => {
    const { x, y } = await middle();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await grasp("held");
    await ada.page.evaluate(() => {
      Object.defineProperty(document, "hidden", { value: true, configurable: true });
      document.dispatchEvent(new Event("visibilitychange"));
      Object.defineProperty(document, "hidden", { value: false, configurable: true });
    });
    await ada.saying("operate-says", "The page was out of sight");
    await grasp("released");
    await ada.page.mouse.move(x + 40, y, { steps: 3 });
    expect(await attribute("scene", "data-grasp")).toBe("released");
    await ada.page.mouse.up();
  });

  it("says that the link is silent, and goes on under the same lease where it is heard again", async () => {
    const joins = standIn.asked.length;
    standIn.isSilent = true;
    await ada.saying("operate-says", "The link is silent");
    standIn.isSilent = false;
    await until("nothing is amiss", async () => (await ada.page.locator("[data-line=silent], [data-line=again]").count()) === 0);
    await standing("in");
    expect(standIn.asked.length).toBeLessThanOrEqual(joins + 1);
  });

  it("turns the view and moves no hand where that is wanted", async () => {
    await ada.page.getByTestId("view-only").check();
    const { x, y } = await middle();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await ada.page.mouse.move(x + 40, y, { steps: 4 });
    await ada.page.mouse.up();
    expect(await attribute("scene", "data-grasp")).toBe("released");
    await ada.page.getByTestId("view-only").uncheck();
  });

  it("says that somebody asks, and hands over to them", async () => {
    standIn.change({}, { requests: ["Bob", "Cy"] });
    await ada.saying("tools", "Cy asks for it");
    await ada.page.getByTestId("deny-control").nth(1).click();
    await until("Cy is denied", () => !standIn.tool.requests.includes("Cy"));
    await until("the page knows of that", async () => (await ada.page.getByTestId("grant-control").count()) === 1);
    await ada.page.getByTestId("grant-control").click();
    await standing("out");
    await ada.saying("operate-says", "handed over to Bob");
    await ada.saying("tool-1", "kept for Bob");
    await ada.page.getByTestId("operate").click();
    await ada.saying("operate-says", "the tool is kept for Bob");
  });

  it("asks for a tool that another holds, and takes it when it is kept for who asked", async () => {
    standIn.change({ state: "running" }, { operator: "Bob", connected: true, reserved_for: null });
    await ada.page.getByTestId("request-control").click();
    await until("the request is there", () => standIn.tool.requests.includes("Ada"));
    await ada.page.getByTestId("withdraw-request").waitFor();
    standIn.change({ state: "idle" }, { operator: "", connected: false, requests: [], reserved_for: "Ada" });
    await standing("in");
    await grasp("released");
  });

  it("gets another lease after the line broke, held by nobody", async () => {
    const { x, y } = await middle();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await grasp("held");
    const joins = (): number => standIn.asked.filter(({ type }) => type === "join").length;
    const before = joins();
    ada.serverIsAway = true;
    standIn.cut();
    await until("another lease is asked for", () => before < joins());
    await standing("in");
    await ada.saying("operate-says", "Take hold anew");
    await grasp("released");
    await ada.page.mouse.move(x + 40, y, { steps: 4 });
    expect(await attribute("scene", "data-grasp")).toBe("released");
    await ada.page.mouse.up();
    ada.serverIsAway = false;
  });

  it("stops everybody, says who and why, and moves again only after it is cleared and taken anew", async () => {
    await ada.page.getByTestId("stop").click();
    await standing("out");
    await ada.saying("situation", "stopped on the page");
    await ada.saying("stopped", "takes hold anew");
    await ada.page.getByTestId("operate").click();
    await ada.saying("operate-says", "The server gives no tool: the session is stopped");
    expect(await ada.text("state")).toBe("stopped");
    expect(await ada.fit("operate-stopped")).toEqual([]);
    await ada.page.getByTestId("clear-stop").click();
    await until("the stop is over", () => standIn.session.stop === null);
    expect(await attribute("operating", "data-standing")).toBe("out");
    await ada.page.getByTestId("operate").click();
    await standing("in");
  });

  it("begins anew where the session's loop is another one, and says so", async () => {
    standIn.parameters = { virtual_mass_kg: 0.8 };
    ada.serverIsAway = true;
    standIn.cut();
    await ada.saying("operate-says", "The session's loop is another one now");
    await standing("in");
    ada.serverIsAway = false;
    await until("the loop runs", async () => 900 < (await ada.number("loop-rate")));
    await grasp("released");
  });

  it("has everything in its place on a desk and on a telephone", async () => {
    const { x, y } = await middle();
    await ada.page.mouse.move(x, y);
    await ada.page.mouse.down();
    await grasp("held");
    const before_m = toolNow();
    await ada.page.mouse.move(x + 50, y + 30, { steps: 8 });
    await until("the tool comes along", () => toolNow()[0] !== before_m[0]);
    await ada.keep("operate-held");
    await ada.page.mouse.up();
    standIn.change({}, { requests: ["Bob of the long name, from the laboratory"] });
    await ada.saying("tools", "asks for it");
    expect(await ada.fit("operate")).toEqual([]);
    for (const summary of ["Wheel, keys, fingers, gamepad", "How the hand is set"]) await ada.page.getByText(summary).click();
    expect(await ada.fit("operate-open")).toEqual([]);
    await ada.page.setViewportSize({ width: 1800, height: 1000 });
    await ada.keep("operate-wide");
    await ada.page.setViewportSize(VIEWPORT);
  });

  it("gives the tool back", async () => {
    await ada.page.getByTestId("release").click();
    await standing("out");
    await until("the server has it back", () => standIn.tool.operator === "");
    expect(standIn.asked.at(-1)).toEqual({ type: "leave" });
  });

  it("takes a tool by its address alone", async () => {
    const other = await WatchedPage.open(browser, `${standIn.url}/#/live?session=demo&operate=1&picture=plain`);
    await until("the guest holds it", () => standIn.tool.operator === "guest");
    await other.page.close();
    await until("a page that has gone holds nothing", () => standIn.tool.operator === "");
    expect([...ada.complaints, ...other.complaints]).toEqual([]);
  });
});

/** Runs in the browser: a gamepad whose stick and button are what the test says. */
function plugIn(): void {
  Object.assign(window, { padButton: 0, padX: 0, rumbles: 0 });
  const pad = {
    id: "a pad for tests", connected: true, mapping: "standard",
    get axes(): number[] { return [Number(Reflect.get(window, "padX")), 0, 0, 0]; },
    get buttons(): { value: number }[] { return [{ value: Number(Reflect.get(window, "padButton")) }]; },
    vibrationActuator: {
      playEffect: () => {
        Object.assign(window, { rumbles: Number(Reflect.get(window, "rumbles")) + 1 });
        return Promise.resolve("complete");
      },
    },
  };
  Object.defineProperty(navigator, "getGamepads", { value: () => [pad], configurable: true });
}
