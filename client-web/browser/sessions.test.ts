// The Sessions page against the real server: sessions are made, duplicated and deleted, and outlive their process.

import { beforeAll, describe, expect, it } from "vitest";
import { benchAt, numberIn } from "./bench";
import type { Teleclay } from "./processes";
import { until } from "./until";
import type { WatchedPage } from "./watched_page";

const CM3 = 1e6;

const opened = benchAt("#/sessions?picture=plain", []);
let teleclay: Teleclay;
let page: WatchedPage;
beforeAll(() => {
  ({ teleclay, page } = opened());
});

describe("the Sessions page", () => {
  it("lists the session that runs: who cuts in it, how much, and what that takes on disk", async () => {
    await until("the session runs", async () => (await stateOf("demo")) === "running");
    const { tools } = await teleclay.session();
    const row = page.page.getByTestId("session-demo");
    expect(await row.locator('[data-label="operators"]').innerText()).toContain(tools[0].operator);
    const removed = async (): Promise<number> => numberIn(await row.locator('[data-label="removed"]').innerText());
    const before = await until("clay is removed", async () => (await removed()) || undefined);
    await until("more clay is removed", async () => before + 1 < (await removed()));
    await until("all of it is saved", async () => (await row.locator('[data-label="storage"]').innerText()).includes("saved"));
    expect(numberIn(await row.locator('[data-label="on disk"]').innerText())).toBeGreaterThan(0);
  });

  it("refuses a name that is none, or is taken, before anything is asked of the server", async () => {
    const create = page.page.getByTestId("create");
    for (const [typed, said] of [
      ["My clay", "“M” cannot stand in a name"],
      ["", "a name is missing"],
      ["demo", "there is a session demo already"],
      ["x".repeat(65), "65 characters are more than a name's 64"],
    ] as const) {
      await page.page.getByTestId("new-name").fill(typed);
      await until(`“${typed}” is refused`, async () => (await page.page.locator("#new-name-fault").innerText()).includes(said));
      expect(await create.isDisabled()).toBe(true);
    }
    await page.keep("sessions-name");
  });

  it("makes what its presets say", async () => {
    await page.page.getByTestId("preset-pair").check();
    await page.page.getByTestId("new-name").fill("two-hands");
    await page.page.getByTestId("create").click();
    await until("the session is listed", async () => (await stateOf("two-hands")) === "idle");
    expect((await teleclay.session("two-hands")).tools).toHaveLength(2);
    const presets = await page.page.locator('[data-testid^="preset-"]').evaluateAll((inputs) =>
      inputs.map((input) => (input instanceof HTMLInputElement ? input.value : "")));
    expect(presets.length).toBeGreaterThan(3);
    for (const preset of presets) {
      await page.page.getByTestId(`preset-${preset}`).check();
      const name = await until("there is a name", async () => (await page.page.getByTestId("new-name").inputValue()) || undefined);
      await page.page.getByTestId("create").click();
      await until(`${name} is listed`, async () => (await stateOf(name)) === "idle");
      // A server takes so many and no more.
      await remove(name);
    }
  });

  it("duplicates: the same clay to the last bit, and from then on another", async () => {
    await pause("demo");
    await page.page.getByTestId("session-demo").getByTestId("duplicate").click();
    expect(await page.page.getByTestId("copy-name").inputValue()).toBe("demo-copy");
    await page.page.keyboard.press("Enter");
    await until("the copy is listed", async () => (await stateOf("demo-copy")) !== undefined);
    const [one, other] = [await teleclay.session(), await teleclay.session("demo-copy")];
    expect(other.clay.hash).toBe(one.clay.hash);
    expect(other.clay.removed_units).toBe(one.clay.removed_units);
    expect(other.material).toEqual(one.material);
    await teleclay.patch("demo", { paused: false });
    await until("one is cut, the other is not", async () => (await teleclay.session()).clay.removed_units !== one.clay.removed_units);
    expect((await teleclay.session("demo-copy")).clay.hash).toBe(other.clay.hash);
  });

  it("asks before it deletes, by keyboard too", async () => {
    const open = async (): Promise<void> => {
      await page.page.getByTestId("session-demo-copy").getByTestId("delete").focus();
      await page.page.keyboard.press("Enter");
      await page.page.getByTestId("delete-dialog").waitFor();
    };
    await open();
    await page.page.keyboard.press("Escape");
    await page.page.getByTestId("delete-dialog").waitFor({ state: "detached" });
    expect(await page.page.evaluate(() => document.activeElement?.getAttribute("aria-label"))).toBe("Delete demo-copy");
    await open();
    // The first answer is the one that does no harm.
    await page.page.keyboard.press("Enter");
    await page.page.getByTestId("delete-dialog").waitFor({ state: "detached" });
    expect(await stateOf("demo-copy")).toBeDefined();
    await open();
    await page.keep("sessions-delete");
    await page.page.keyboard.press("Tab");
    await page.page.keyboard.press("Enter");
    await until("the session is gone", async () => (await stateOf("demo-copy")) === undefined);
    expect((await fetch(`${teleclay.url}/api/v1/sessions/demo-copy`)).status).toBe(404);
  });

  it("has the same sessions, with the same clay, when the server comes back from a sudden end", async () => {
    await pause("demo");
    // A hand that is there would come back and go on.
    await teleclay.killHandles();
    const before = await until("all of it is saved", async () => {
      const now = await teleclay.session();
      return now.storage.state === "durable" && !now.tools[0].connected ? now : undefined;
    });
    page.serverIsAway = true;
    await teleclay.killServer();
    await until("the list is told to be old", async () => (await page.page.getByTestId("sessions").getAttribute("data-known")) === "away");
    expect(await stateOf("demo")).toBeDefined();
    await teleclay.startServer();
    await until("the list is new", async () => (await page.page.getByTestId("sessions").getAttribute("data-known")) === "known");
    page.serverIsAway = false;
    expect(await stateOf("two-hands")).toBe("idle");
    const after = await teleclay.session();
    expect(after.clay.hash).toBe(before.clay.hash);
    expect(after.state).toBe("paused");
    await teleclay.patch("demo", { paused: false });
    teleclay.startHandle();
    const removed = before.clay.removed_volume_m3 * CM3;
    await until("the hand is back and cuts", async () => removed + 0.5 < CM3 * (await teleclay.session()).clay.removed_volume_m3);
  });

  it("says why a damaged session cannot be opened, and can delete it", async () => {
    page.serverIsAway = true;
    await teleclay.killServer();
    teleclay.damage("two-hands");
    await teleclay.startServer();
    await until("it is told to be damaged", async () => (await stateOf("two-hands")) === "damaged");
    page.serverIsAway = false;
    const row = page.page.getByTestId("session-two-hands");
    expect((await row.locator(".reason").innerText()).length).toBeGreaterThan(10);
    expect(await row.getByTestId("open").count()).toBe(0);
    // Nor does any other page offer it.
    expect(await page.page.locator(".choice option").allInnerTexts()).not.toContain("two-hands");
    await page.keep("sessions-damaged");
    await remove("two-hands");
    expect((await fetch(`${teleclay.url}/api/v1/sessions/two-hands`)).status).toBe(404);
  });

  it("opens a session on Live", async () => {
    await teleclay.create({ id: "opened" });
    await until("it is listed", async () => (await stateOf("opened")) === "idle");
    await page.page.getByTestId("session-opened").getByTestId("open").click();
    await until("it is on show", async () => (await page.page.title()) === "idle · opened · teleclay");
    expect(await page.page.evaluate(() => location.hash)).toContain("#/live?");
    await page.page.getByRole("link", { name: "Sessions" }).click();
    await until("the list is back", async () => (await stateOf("opened")) === "idle");
    await remove("opened");
  });

  it("fits desk and telephone, light and dark", async () => {
    await until("a session is on show", async () => (await page.page.title()).includes("demo"));
    expect(await page.fit("sessions")).toEqual([]);
  });

  it("gives the browser nothing to complain about", () => {
    expect(page.complaints).toEqual([]);
  });
});

/** What the list says of a session's state; nothing where it does not have it. */
async function stateOf(session: string): Promise<string | undefined> {
  // At one look: the list may change between two.
  const states = await page.page.getByTestId(`session-${session}`).evaluateAll((rows) => rows.map((row) => row.getAttribute("data-state")));
  return states.at(0) ?? undefined;
}

async function remove(session: string): Promise<void> {
  await page.page.getByTestId(`session-${session}`).getByTestId("delete").click();
  await page.page.getByTestId("delete-now").click();
  await until(`${session} is gone`, async () => (await stateOf(session)) === undefined);
}

/** Pauses a session, and waits until its clay stays as it is. */
async function pause(session: string): Promise<void> {
  await teleclay.patch(session, { paused: true });
  let last = await teleclay.session(session);
  await until("nothing is cut any more", async () => {
    const next = await teleclay.session(session);
    const isStill = next.state === "paused" && last.loop.ticks + 200 < next.loop.ticks && next.clay.hash === last.clay.hash;
    if (last.loop.ticks + 200 < next.loop.ticks) last = next;
    return isStill;
  });
}
