import { describe, expect, it } from "vitest";
import { Api } from "./api";
import { FakePlatform } from "./fake_platform";

describe("what is asked about tools", () => {
  it("has the server's paths and words", async () => {
    const platform = new FakePlatform();
    platform.answer = () => ({ status: 200, body: "{}" });
    const api = new Api(platform);
    await api.request("a b", 2, "Ada");
    await api.withdraw("demo", 1, "Ada");
    await api.grant("demo", 1, "Bob");
    await api.deny("demo", 1, "Bob");
    await api.takeAway("demo", 1);
    await api.stop("demo", "Ada", "a cable");
    await api.clearStop("demo", "Ada");
    expect(platform.requests.map(({ method, path, body }) => [method, path, body])).toEqual([
      ["POST", "api/v1/sessions/a%20b/tools/2/request", { operator: "Ada" }],
      ["POST", "api/v1/sessions/demo/tools/1/withdraw", { operator: "Ada" }],
      ["POST", "api/v1/sessions/demo/tools/1/grant", { operator: "Bob" }],
      ["POST", "api/v1/sessions/demo/tools/1/deny", { operator: "Bob" }],
      ["POST", "api/v1/sessions/demo/tools/1/release", undefined],
      ["POST", "api/v1/sessions/demo/stop", { operator: "Ada", reason: "a cable" }],
      ["POST", "api/v1/sessions/demo/stop/clear", { operator: "Ada" }],
    ]);
  });
});
