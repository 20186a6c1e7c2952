import js from "@eslint/js";
import tseslint from "typescript-eslint";

/** A folder's borders: what may not be imported there, and why. */
function border(files, patterns, ignores = []) {
  return { files, ignores, rules: { "no-restricted-imports": ["error", { patterns }] } };
}

const three = { group: ["three", "three/*"], message: "only scene/ imports three" };
const uplot = { group: ["uplot", "uplot/*"], message: "only plots/ imports the plotting library" };
const preact = {
  group: ["preact", "preact/*", "@preact/signals"],
  message: "pure folders know no components; state/ uses @preact/signals-core",
};
const signals = { group: ["@preact/signals-core"], message: "signals belong to state/ and ui/" };
const valibot = { group: ["valibot"], message: "data is checked once, in protocol/" };
const upwards = (...rooms) => ({
  group: rooms.flatMap((room) => [`**/${room}/*`]),
  message: "rooms import downwards only: protocol < clay, film, hand, theory < state < scene, plots < ui",
});

// What the platform offers to pages: pure folders get what they need of it as arguments.
const page = [
  "window", "document", "navigator", "location", "localStorage", "sessionStorage", "history", "screen",
  "requestAnimationFrame", "cancelAnimationFrame", "matchMedia", "fetch", "WebSocket", "Worker", "self",
  "setTimeout", "clearTimeout", "setInterval", "clearInterval", "performance",
].map((name) => ({ name, message: "protocol/, clay/, film/, hand/, theory/ and state/ touch no DOM, clock or socket: take it as an argument" }));

const tests = ["src/**/*.test.ts"];

export default tseslint.config(
  { ignores: ["dist", "browser/out", "generated"] },
  js.configs.recommended,
  ...tseslint.configs.strictTypeChecked,
  ...tseslint.configs.stylisticTypeChecked,
  {
    languageOptions: { parserOptions: { projectService: { allowDefaultProject: ["eslint.config.js", "scripts/*.mjs"] } } },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      eqeqeq: "error",
      "no-console": "error", // the page reports in the page
      "max-lines": ["error", { max: 300, skipComments: true, skipBlankLines: true }],
      "@typescript-eslint/consistent-type-imports": "error",
      "@typescript-eslint/switch-exhaustiveness-check": "error",
      // Numbers in templates are what a dashboard does all day.
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      // An arrow that forwards a void call is the shortest event handler there is.
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true }],
      // Casts live in protocol/ alone, where bytes and JSON become types.
      "@typescript-eslint/consistent-type-assertions": ["error", { assertionStyle: "never" }],
      "@typescript-eslint/no-non-null-assertion": "error",
    },
  },
  {
    files: ["src/protocol/**", ...tests],
    rules: { "@typescript-eslint/consistent-type-assertions": ["error", { assertionStyle: "as" }] },
  },
  {
    files: ["src/protocol/**/*.ts", "src/clay/**/*.ts", "src/film/**/*.ts", "src/hand/**/*.ts", "src/theory/**/*.ts", "src/state/**/*.ts"],
    ignores: [...tests, "src/clay/worker.ts", "src/clay/past_worker.ts", "src/film/worker.ts", "src/hand/worker.ts"],
    rules: { "no-restricted-globals": ["error", ...page] },
  },
  border(["src/protocol/**"], [three, uplot, preact, signals, upwards("clay", "film", "hand", "theory", "state", "scene", "plots", "ui")], tests),
  border(["src/clay/**"], [three, uplot, preact, signals, valibot, upwards("film", "hand", "theory", "state", "scene", "plots", "ui")], tests),
  border(["src/film/**"], [three, uplot, preact, signals, valibot, upwards("clay", "hand", "theory", "state", "scene", "plots", "ui")], tests),
  border(["src/hand/**"], [three, uplot, preact, signals, valibot, upwards("clay", "film", "theory", "state", "scene", "plots", "ui")], tests),
  border(["src/theory/**"], [three, uplot, preact, signals, valibot, upwards("clay", "film", "hand", "state", "scene", "plots", "ui")], tests),
  border(["src/state/**"], [three, uplot, preact, valibot, upwards("scene", "plots", "ui")], tests),
  border(["src/scene/**"], [uplot, preact, signals, valibot, upwards("state", "plots", "ui")], tests),
  border(["src/plots/**"], [three, preact, signals, valibot, upwards("clay", "scene", "ui")], tests),
  border(["src/ui/**", "src/main.tsx"], [three, uplot, valibot]),
  { files: ["eslint.config.js", "scripts/*.mjs"], ...tseslint.configs.disableTypeChecked },
);
