import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

// The server that `npm run dev` talks to; the built page asks whoever served it.
const server = process.env["TELECLAY_SERVER"] ?? "http://127.0.0.1:8080";

/**
 * Has the 3-D view come beside the rest of the page. It is imported when the page has been drawn, and would only be
 * asked for then.
 */
function viewComesEarly(): Plugin {
  return {
    name: "view-comes-early",
    apply: "build",
    transformIndexHtml: {
      order: "post",
      handler(html, { bundle }) {
        const view = Object.values(bundle ?? {}).find((file) => file.type === "chunk" && file.name === "view");
        const files = view?.type === "chunk" ? [view.fileName, ...view.imports] : [];
        return files.filter((file) => !html.includes(file))
          .map((file) => ({ tag: "link", attrs: { rel: "modulepreload", crossorigin: true, href: `./${file}` }, injectTo: "head" }));
      },
    },
  };
}

export default defineConfig({
  plugins: [viewComesEarly()],
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
