import { defineConfig } from "vitest/config";

// Real processes and a real browser: one file after the other, each step bounded by its own deadline.
export default defineConfig({
  test: {
    include: ["browser/**/*.test.ts"],
    environment: "node",
    fileParallelism: false,
    testTimeout: 300_000,
    hookTimeout: 200_000,
  },
});
