import { describe, expect, it } from "vitest";
import { FakePlatform } from "./fake_platform";
import { Tables } from "./tables";

const TABLE = JSON.stringify({ wall: [], cells: [] });

function serving(paths: string[], table: { status: number; body: string }): FakePlatform {
  const platform = new FakePlatform();
  platform.answer = (_method, path) =>
    path.endsWith("openapi.json") ? { status: 200, body: JSON.stringify({ openapi: "3.1.0", paths: Object.fromEntries(paths.map((p) => [p, {}])) }) } : table;
  return platform;
}

describe("the latency table", () => {
  it("is the server's where it offers one", async () => {
    const tables = new Tables(serving(["/api/v1/latency-table"], { status: 200, body: TABLE }));
    await tables.look();
    expect(tables.state.value).toEqual({ name: "shown", table: { wall: [], cells: [] }, origin: "this server" });
  });

  it("is not asked for where there is none, so that nothing is logged as an error", async () => {
    const platform = serving(["/api/v1/sessions"], { status: 404, body: "" });
    const tables = new Tables(platform);
    await tables.look();
    expect(tables.state.value.name).toBe("none");
    expect(platform.requests.map(({ path }) => path)).toEqual(["api/v1/openapi.json"]);
  });

  it("is the published one where the server has none, and the server's where it has", async () => {
    const platform = serving([], { status: 200, body: TABLE });
    const tables = new Tables(platform, "assets/latency.json");
    await tables.look();
    expect(tables.state.value).toMatchObject({ name: "shown", origin: "published with this page" });
    expect(platform.requests.map(({ path }) => path)).toEqual(["api/v1/openapi.json", "assets/latency.json"]);
    const own = new Tables(serving(["/api/v1/latency-table"], { status: 200, body: TABLE }), "assets/latency.json");
    await own.look();
    expect(own.state.value).toMatchObject({ origin: "this server" });
  });

  it("is none where the published one cannot be had", async () => {
    const tables = new Tables(serving([], { status: 404, body: "" }), "assets/latency.json");
    await tables.look();
    expect(tables.state.value).toMatchObject({ name: "none" });
  });

  it("may come from a file, and one that is no table leaves the last one on show", async () => {
    const tables = new Tables(serving([], { status: 404, body: "" }));
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
