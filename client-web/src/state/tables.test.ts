import { describe, expect, it } from "vitest";
import { FakePlatform } from "./fake_platform";
import { Tables } from "./tables";

const TABLE = JSON.stringify({ wall: [], cells: [] });

function serving(status: number, body: string): FakePlatform {
  const platform = new FakePlatform();
  platform.answer = () => ({ status, body });
  return platform;
}

describe("the latency table", () => {
  it("is the one that came with the page", async () => {
    const platform = serving(200, TABLE);
    const tables = new Tables(platform, "assets/latency.json");
    await tables.look();
    expect(tables.state.value).toEqual({ name: "shown", table: { wall: [], cells: [] }, origin: "published with this page" });
    expect(platform.requests.map(({ path }) => path)).toEqual(["assets/latency.json"]);
  });

  it("is none where the page came without one, and nothing is asked for", async () => {
    const platform = serving(404, "");
    const tables = new Tables(platform);
    await tables.look();
    expect(tables.state.value).toMatchObject({ name: "none", reason: "This page came without a table." });
    expect(platform.requests).toEqual([]);
  });

  it("is none where it cannot be had or read, and the reason is told", async () => {
    for (const [status, body, reason] of [[404, "", "status 404"], [200, "{}", "cannot be read"]] as const) {
      const tables = new Tables(serving(status, body), "assets/latency.json");
      await tables.look();
      expect(tables.state.value).toMatchObject({ name: "none" });
      expect(JSON.stringify(tables.state.value)).toContain(reason);
    }
  });

  it("may come from a file, and one that is no table leaves the last one on show", async () => {
    const tables = new Tables(serving(404, ""));
    await tables.look();
    tables.read(TABLE, "table.json");
    expect(tables.state.value).toMatchObject({ name: "shown", origin: "table.json" });
    tables.read('{"cells": [{}]}', "other.json");
    expect(tables.state.value).toMatchObject({ name: "shown", origin: "table.json" });
    expect(tables.refusal.value).toContain("other.json is no latency table");
    await tables.look();
    expect(tables.state.value).toMatchObject({ origin: "table.json" });
  });
});
