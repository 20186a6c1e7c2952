import { defineConfig } from "vitest/config";

// What a page and a hand in it cost. Figures for an idle machine, so no part of the tests.
export default defineConfig({
  test: {
    include: ["browser/**/*.figures.ts"],
    environment: "node",
    fileParallelism: false,
    testTimeout: 1_800_000,
    hookTimeout: 200_000,
  },
});
