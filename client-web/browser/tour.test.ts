// The tour of the Live page: on a first visit, and whenever it is asked for.

import { beforeAll, describe, expect, it } from "vitest";
import { STEPS } from "../src/ui/tour/steps";
import { benchAt } from "./bench";
import { until } from "./until";
import { WatchedPage } from "./watched_page";

const opened = benchAt("#/live?picture=plain&tour=1", []);
let live: WatchedPage;
beforeAll(() => {
  live = opened().page;
});

describe("the tour", () => {
  it("is shown by its address, once: the address that is passed on is that of the page", async () => {
    await tour().waitFor();
    expect(live.page.url()).toMatch(/#\/live\?picture=plain$/);
  });

  it("takes nothing from the page: neither the focus nor a press", async () => {
    expect(await live.page.evaluate(() => document.activeElement?.tagName)).toBe("BODY");
    await live.page.getByTestId("plots-hold").click();
    await live.page.getByText("Go on").click();
    await live.choose("plots", "link");
    await live.choose("plots", "motion");
    expect(await tour().isVisible()).toBe(true);
  });

  it("points at one thing after another, and last at where one takes a tool, if that is there", async () => {
    const targets: string[] = [];
    for (let n = 0; n < STEPS.length && (await tour().count()) === 1; n += 1) {
      const target = (await tour().getAttribute("data-target")) ?? "";
      targets.push(target);
      // Its place is that of the next frame, and the page may have to go there first.
      await until(`the ring stands about ${target}`, async () => {
        const [ring, box] = [await live.page.locator(".tour-ring").boundingBox(), await live.page.locator(target).first().boundingBox()];
        return ring !== null && box !== null && (["x", "y", "width", "height"] as const).every((side) => Math.abs(ring[side] - box[side]) < 0.5);
      });
      await live.keep(`tour-${n + 1}`);
      await live.page.getByTestId("tour-next").click();
      await until("there is another step, or none", async () =>
        (await tour().count()) === 0 || (await tour().getAttribute("data-target")) !== target);
    }
    const there = await Promise.all(STEPS.map(async ({ target }) => ({ target, count: await live.page.locator(target).count() })));
    expect(targets).toEqual(there.filter(({ count }) => 0 < count).map(({ target }) => target));
    expect(targets.length).toBeGreaterThanOrEqual(5);
    expect(await tour().count()).toBe(0);
  });

  it("comes back by its button, goes on by keyboard, and ends with escape", async () => {
    await live.page.getByTestId("tour-button").press("Enter");
    await until("the keys are the tour's", async () => (await live.page.locator(":focus").getAttribute("data-testid")) === "tour-next");
    const first = await tour().getAttribute("data-target");
    await live.page.keyboard.press("Enter");
    await until("the next step is shown", async () => (await tour().getAttribute("data-target")) !== first);
    await until("the keys are the tour's still", async () => (await live.page.locator(":focus").getAttribute("data-testid")) === "tour-next");
    await live.page.keyboard.press("Escape");
    await until("it is over", async () => (await tour().count()) === 0);
  });

  it("is within the window on a telephone, and goes to what it points at", async () => {
    await live.page.setViewportSize({ width: 390, height: 844 });
    await live.page.getByTestId("tour-button").click();
    for (let n = 1; (await tour().count()) === 1; n += 1) {
      const target = await tour().getAttribute("data-target");
      await until("the card is within the window", async () => {
        const box = await tour().boundingBox();
        return box !== null && 0 <= box.x && 0 <= box.y && box.x + box.width <= 390 && box.y + box.height <= 844;
      });
      await live.keep(`tour-telephone-${n}`);
      await live.page.getByTestId("tour-next").click();
      await until("there is another step, or none", async () =>
        (await tour().count()) === 0 || (await tour().getAttribute("data-target")) !== target);
    }
  });

  it("is shown on a first visit by itself, and on no later one", async () => {
    const browser = live.page.context().browser();
    if (browser === null) throw new Error("the browser is gone");
    const visitor = await WatchedPage.open(browser, `${opened().teleclay.url}/#/live?picture=plain`, "first");
    await visitor.page.getByTestId("tour").waitFor();
    await visitor.page.getByTestId("tour-end").click();
    await visitor.page.reload({ waitUntil: "commit" });
    await visitor.page.getByTestId("tour-button").waitFor();
    await until("the page is there", async () => (await visitor.text("state")) === "running");
    expect(await visitor.page.getByTestId("tour").count()).toBe(0);
    expect(visitor.complaints).toEqual([]);
    await visitor.page.context().close();
  });

  it("gives the browser nothing to complain about", () => {
    expect(live.complaints).toEqual([]);
  });
});

const tour = (): ReturnType<typeof live.page.getByTestId> => live.page.getByTestId("tour");
