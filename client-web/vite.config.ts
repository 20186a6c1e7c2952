import { defineConfig } from "vitest/config";

// The server that `npm run dev` talks to; the built page asks whoever served it.
const server = process.env["TELECLAY_SERVER"] ?? "http://127.0.0.1:8080";

export default defineConfig({
  // Relative addresses: the page also works below a path of a reverse proxy.
  base: "./",
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  worker: { format: "es" },
  build: {
    target: "es2023",
    // three alone is above the default warning; it is one chunk of its own and cached apart from our code.
    chunkSizeWarningLimit: 700,
    rolldownOptions: {
      output: {
        codeSplitting: {
          groups: [
            { name: "three", test: /node_modules[\\/]three[\\/]/ },
            { name: "vendor", test: /node_modules[\\/]/ },
          ],
        },
      },
    },
  },
  server: {
    proxy: {
      // The server checks the Origin of whatever changes something: through the proxy it must see its own.
      "/api": {
        target: server,
        ws: true,
        changeOrigin: true,
        rewriteWsOrigin: true,
        configure: (proxy) => proxy.on("proxyReq", (request) => {
          if (request.hasHeader("origin")) request.setHeader("origin", server);
        }),
      },
      "/healthz": { target: server },
      "/readyz": { target: server },
    },
  },
  test: {
    include: ["src/**/*.test.ts"],
    environment: "node",
    // Meshes are compared edge by edge, and the machine may be busy building the rest.
    testTimeout: 60_000,
  },
});
