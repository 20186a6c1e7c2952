// A page in Chromium that reports what the browser complains about, and pictures that can be compared.

import { chmodSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { extname, join, resolve } from "node:path";
import { type Browser, chromium, type Page, type Route } from "playwright-core";
import { until } from "./until";

const OUT = join(import.meta.dirname, "out");

/** The software renderer remarks on its own slowness. */
const RENDERERS_OWN = "GL Driver Message (OpenGL, Performance";
/** These tests read figures pixel by pixel, which no page does. */
const TESTS_OWN = "Canvas2D: Multiple readback operations";
/** While the server is away, Chromium itself logs every request that finds nobody. */
const NOBODY_THERE = /net::ERR_(CONNECTION_REFUSED|CONNECTION_RESET|EMPTY_RESPONSE|SOCKET_NOT_CONNECTED|CONNECTION_CLOSED)/;

/**
 * Where the page comes from instead of from the server under test: a build that is newer than the server, as in `dist`.
 */
const DASHBOARD = process.env["TELECLAY_DASHBOARD_DIR"];
/** What the server answers itself all the same. */
const SERVERS_OWN = /^\/(api|healthz|readyz|metrics|problems)(\/|$)/;
const TYPES: Readonly<Record<string, string>> = {
  ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".svg": "image/svg+xml", ".json": "application/json",
};
/** Isolated, as by the server: its workers sleep to the fraction of a millisecond. */
const ISOLATED = { "cross-origin-opener-policy": "same-origin", "cross-origin-embedder-policy": "require-corp" };

/** Chromium as root and without a graphics card, talking to nobody. */
const FLAGS = [
  "--no-sandbox", "--enable-unsafe-swiftshader", "--headless", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--no-first-run",
  // What a test hands over itself, a page or a worker, has no address in Chromium's eyes, and may then open no socket
  // to this machine.
  "--disable-features=LocalNetworkAccessChecks",
];

/** A click waits this long for a page that a loaded machine draws, ms. */
const PATIENCE_MS = 60_000;

/** Small: without a graphics card every pixel is drawn by a processor that the loop under test needs as well. */
export const VIEWPORT = { width: 1024, height: 640 };

/**
 * Chromium raises its own priority where it may, as root may, above that of the threads that carry the loop's frames.
 */
const POLITE = `#!/bin/sh
if [ "$(id -u)" = 0 ]; then set -- setpriv --bounding-set=-sys_nice "$TELECLAY_CHROMIUM" "$@"
else set -- "$TELECLAY_CHROMIUM" "$@"
fi
exec nice -n 10 "$@"
`;

interface Point {
  readonly x: number;
  readonly y: number;
}

/** Where people read the page. */
const DEVICES = { desk: { width: 1280, height: 800 }, telephone: { width: 390, height: 844 } };

/** Chromium, as polite as can be: on two cores its drawing must not be what makes the loop late. */
export function launch(): Promise<Browser> {
  mkdirSync(OUT, { recursive: true });
  const polite = join(OUT, "chromium");
  writeFileSync(polite, POLITE);
  chmodSync(polite, 0o755);
  return chromium.launch({
    executablePath: polite,
    headless: true,
    args: FLAGS,
    env: { ...process.env, TELECLAY_CHROMIUM: process.env["TELECLAY_CHROMIUM"] ?? "/usr/bin/chromium" },
  });
}

/** What answers a request for a file of the page. */
export async function fileFor(route: Route): Promise<{ headers: Record<string, string>; body: Buffer }> {
  if (DASHBOARD === undefined) {
    const response = await route.fetch();
    // The body is unpacked, and may become another one.
    const headers = Object.entries(response.headers()).filter(([name]) => !["content-encoding", "content-length"].includes(name));
    return { headers: Object.fromEntries(headers), body: await response.body() };
  }
  const { pathname } = new URL(route.request().url());
  const file = pathname === "/" ? "/index.html" : pathname;
  return { headers: { ...ISOLATED, "content-type": TYPES[extname(file)] ?? "application/octet-stream" }, body: readFileSync(join(resolve(DASHBOARD), file)) };
}

export class WatchedPage {
  readonly page: Page;
  readonly complaints: string[] = [];
  readonly #bench: Page;
  /** Set while the server is meant to be away. */
  serverIsAway = false;

  private constructor(page: Page, bench: Page) {
    this.page = page;
    this.#bench = bench;
    page.on("console", (message) => {
      if (message.type() !== "error" && message.type() !== "warning") return;
      const text = message.text();
      if (text.includes(RENDERERS_OWN) || text.includes(TESTS_OWN) || (this.serverIsAway && NOBODY_THERE.test(text))) return;
      this.complaints.push(`${message.type()}: ${text} (${message.location().url})`);
    });
    page.on("pageerror", (error) => this.complaints.push(`uncaught: ${error.stack ?? error.message}`));
  }

  /** `visit`: whoever tests another thing has seen the tour; `#/live?tour=1` shows it all the same. */
  static async open(browser: Browser, url: string, visit: "first" | "later" = "later", onRequest?: (pathname: string) => void): Promise<WatchedPage> {
    const context = await browser.newContext({ viewport: VIEWPORT, colorScheme: "light", reducedMotion: "reduce" });
    context.setDefaultTimeout(PATIENCE_MS);
    if (visit === "later") await context.addInitScript(() => localStorage.setItem("teleclay.tour", "seen"));
    if (DASHBOARD !== undefined) {
      await context.route(({ pathname }) => !SERVERS_OWN.test(pathname), async (route) => route.fulfill(await fileFor(route)));
    }
    if (onRequest !== undefined) context.on("request", (request) => { onRequest(new URL(request.url()).pathname); });
    const watched = new WatchedPage(await context.newPage(), await browser.newPage());
    // The page draws as soon as it can, and without a graphics card that may hold up its load event for long.
    await watched.page.goto(url, { waitUntil: "commit" });
    return watched;
  }

  /** Strikes what a test brought about on purpose. */
  forgive(part: string): void {
    this.complaints.splice(0, this.complaints.length, ...this.complaints.filter((text) => !text.includes(part)));
  }

  text(id: string): Promise<string> {
    return this.page.getByTestId(id).innerText();
  }

  /** The number an instrument of the page shows. */
  async number(id: string): Promise<number> {
    return Number.parseFloat((await this.text(id)).replace("−", "-").replaceAll(/[  ]/g, ""));
  }

  /** Milliseconds that an instrument shows, in whichever unit. */
  async milliseconds(id: string): Promise<number> {
    const unit = /(µs|ms|s)\s*$/.exec(await this.text(id))?.[1];
    return (await this.number(id)) * (unit === "µs" ? 1e-3 : unit === "s" ? 1e3 : 1);
  }

  /** Types a setting into its field. */
  async set(pointer: string, text: string): Promise<void> {
    const field = this.page.getByTestId(pointer).getByRole("textbox");
    await field.fill(text);
    await field.press("Enter");
  }

  /** What a field of a setting shows. */
  shown(pointer: string): Promise<string> {
    return this.page.getByTestId(pointer).getByRole("textbox").inputValue();
  }

  /**
   * Chooses one of a few, where a person would press: on the label, for the radio button itself may be drawn as
   * something else.
   */
  async choose(group: string, value: string): Promise<void> {
    const input = this.page.getByTestId(group).locator(`input[value="${value}"]`);
    await this.page.getByTestId(group).locator("label").filter({ has: this.page.locator(`input[value="${value}"]`) }).click();
    await until(`${group} is ${value}`, () => input.isChecked());
  }

  /** Waits until an instrument says something in particular. */
  saying(id: string, words: RegExp | string): Promise<string> {
    return until(`${id} says ${String(words)}`, async () => {
      if ((await this.page.getByTestId(id).count()) === 0) return undefined;
      const text = await this.text(id);
      return (typeof words === "string" ? text.includes(words) : words.test(text)) ? text : undefined;
    });
  }

  /**
   * Looks at the page on a desk and on a telephone, light and dark, keeps the four pictures, and returns what sticks
   * out of the page or of its own box.
   */
  async fit(name: string): Promise<string[]> {
    const out: string[] = [];
    for (const [device, viewport] of Object.entries(DEVICES)) {
      await this.page.setViewportSize(viewport);
      for (const theme of ["light", "dark"] as const) {
        await this.wear(theme);
        await this.page.screenshot({ path: join(OUT, `${name}-${device}-${theme}.png`), fullPage: true });
      }
      const found = await this.page.evaluate(sticksOut);
      out.push(...found.map((text) => `${device}: ${text}`));
    }
    await this.page.setViewportSize(VIEWPORT);
    await this.wear("light");
    return out;
  }

  /** Presses the button until the page wears a theme. */
  async wear(theme: "light" | "dark"): Promise<void> {
    const button = this.page.getByRole("button", { name: /Theme/ });
    await until(`the theme is ${theme}`, async () => {
      if ((await button.getAttribute("title")) === `theme: ${theme}`) return true;
      await button.click();
      return undefined;
    });
  }

  /** The picture of the clay, without what is written over it, once it stands still. */
  async pictureAtRest(alike = 0): Promise<Buffer> {
    let last = await this.picture();
    // Each look takes a picture of its own, which without a graphics card is slow.
    return until("the picture stands still", async () => {
      const next = await this.picture();
      if (await this.share(last, next) <= alike) return next;
      last = next;
      return undefined;
    }, 200);
  }

  async picture(): Promise<Buffer> {
    const box = await this.page.getByTestId("clay").boundingBox();
    if (box === null) throw new Error("the clay is not on the page");
    return this.page.screenshot({ clip: box, style: ".clay > :not(canvas) { visibility: hidden }" });
  }

  /** A figure's canvas, as it is drawn. */
  canvas(id: string): Promise<Buffer> {
    return this.page.getByTestId(id).locator("canvas").screenshot();
  }

  /** Where a figure has its origin, and how long one unit is along either axis, in pixels of the figure. */
  async figure(id: string): Promise<{ zero_px: Point; unit_px: Point }> {
    const figure = this.page.getByTestId(id);
    const [zero, one] = await Promise.all(["data-zero-px", "data-one-px"].map(async (name) =>
      ((await figure.getAttribute(name)) ?? "").split(" ").map(Number)));
    return { zero_px: { x: zero[0], y: zero[1] }, unit_px: { x: one[0] - zero[0], y: zero[1] - one[1] } };
  }

  /** Pixels of a figure in the colour that a custom property of the style sheet holds now. */
  inked(id: string, property: string): Promise<number> {
    return this.page.getByTestId(id).evaluate(countInked, { property, about: undefined });
  }

  /** The same, within a radius of a point, pixels. */
  inkedAt(id: string, property: string, about: Point & { readonly radius: number }): Promise<number> {
    return this.page.getByTestId(id).evaluate(countInked, { property, about });
  }

  /** Share of pixels, 0 … 1, that differ clearly between two pictures. */
  share(a: Buffer, b: Buffer): Promise<number> {
    return this.#bench.evaluate(shareThatDiffers, [a.toString("base64"), b.toString("base64")]);
  }

  async keep(name: string): Promise<void> {
    await this.page.screenshot({ path: join(OUT, `${name}.png`) });
  }
}

/** Runs in the browser: counts the pixels of the figure's canvas that have the property's colour. */
function countInked(
  figure: Element,
  { property, about }: { property: string; about: { x: number; y: number; radius: number } | undefined },
): number {
  const canvas = figure.querySelector("canvas");
  const probe = new OffscreenCanvas(1, 1).getContext("2d");
  const context = canvas?.getContext("2d");
  if (canvas === null || context === null || context === undefined || probe === null) throw new Error("no canvas to look at");
  probe.fillStyle = getComputedStyle(figure).getPropertyValue(property).trim();
  probe.fillRect(0, 0, 1, 1);
  const [red, green, blue] = probe.getImageData(0, 0, 1, 1).data;
  const scale = canvas.width / canvas.clientWidth;
  const { x, y, radius } = about ?? { x: canvas.clientWidth / 2, y: canvas.clientHeight / 2, radius: canvas.width };
  const { data, width } = context.getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    const [px, py] = [(i / 4) % width, Math.floor(i / 4 / width)];
    if (radius < Math.max(Math.abs(px / scale - x), Math.abs(py / scale - y))) continue;
    const distance = Math.abs(data[i] - red) + Math.abs(data[i + 1] - green) + Math.abs(data[i + 2] - blue);
    if (distance < 30 && 200 < data[i + 3]) count += 1;
  }
  return count;
}

/** Runs in the browser: what lies beyond the page's sides, and text that is longer than its own box. */
function sticksOut(): string[] {
  const found: string[] = [];
  const width = document.documentElement.clientWidth;
  if (width < document.documentElement.scrollWidth) found.push(`the page is ${document.documentElement.scrollWidth} px wide on ${width}`);
  const nameOf = (element: Element): string =>
    `${element.tagName.toLowerCase()}.${element.getAttribute("class") ?? ""} “${element.textContent.trim().slice(0, 40)}”`;
  const scrolls = (element: Element | null): boolean => {
    for (let at = element; at !== null; at = at.parentElement) if (/auto|scroll/.test(getComputedStyle(at).overflowX)) return true;
    return false;
  };
  for (const element of document.querySelectorAll("#app *")) {
    const style = getComputedStyle(element);
    const box = element.getBoundingClientRect();
    const unseen = style.visibility === "hidden" || style.opacity === "0" || style.clipPath !== "none" || box.width < 2;
    if (unseen || scrolls(element.parentElement)) continue;
    if (box.left < -1 || width + 1 < box.right) found.push(`beyond the side: ${nameOf(element)}`);
    const hasText = [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent?.trim() !== "");
    const isCut = element.clientWidth + 1 < element.scrollWidth && 0 < element.clientWidth && style.textOverflow !== "ellipsis";
    const hides = /hidden|clip/.test(style.overflowX) && isCut && element.querySelector("canvas") === null;
    if ((hasText && isCut) || hides) found.push(`longer than its box: ${nameOf(element)}`);
  }
  return [...new Set(found)];
}

/** Runs in the browser, which can read PNG. */
async function shareThatDiffers(pictures: string[]): Promise<number> {
  const pixels = await Promise.all(pictures.map(async (base64) => {
    const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    if (context === null) throw new Error("no canvas to compare on");
    context.drawImage(bitmap, 0, 0);
    return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
  }));
  const [a, b] = pixels;
  let differing = 0;
  for (let i = 0; i < a.length; i += 4) {
    const distance = Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) + Math.abs(a[i + 2] - b[i + 2]);
    // Fewer than eight steps a colour are the work of dithering, not of clay.
    if (24 < distance) differing += 1;
  }
  return (4 * differing) / a.length;
}
