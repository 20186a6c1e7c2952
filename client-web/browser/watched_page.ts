// A page in Chromium that reports what the browser complains about, and pictures that can be compared.

import { chmodSync, mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { type Browser, chromium, type Page } from "playwright-core";
import { until } from "./until";

const OUT = join(import.meta.dirname, "out");

/** Chromium as root and without a graphics card, talking to nobody. */
const FLAGS = [
  "--no-sandbox", "--enable-unsafe-swiftshader", "--headless", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--no-first-run",
];

/** The software renderer remarks on its own slowness. */
const RENDERERS_OWN = "GL Driver Message (OpenGL, Performance";
/** While the server is away, Chromium itself logs every request that finds nobody. */
const NOBODY_THERE = /net::ERR_(CONNECTION_REFUSED|CONNECTION_RESET|EMPTY_RESPONSE|SOCKET_NOT_CONNECTED|CONNECTION_CLOSED)/;

/** Small: without a graphics card every pixel is drawn by a processor that the loop under test needs as well. */
export const VIEWPORT = { width: 1024, height: 640 };

/** Chromium raises its own priority where it may, as root may, above that of the threads that carry the loop's frames. */
const POLITE = `#!/bin/sh
if [ "$(id -u)" = 0 ]; then set -- setpriv --bounding-set=-sys_nice "$TELECLAY_CHROMIUM" "$@"
else set -- "$TELECLAY_CHROMIUM" "$@"
fi
exec nice -n 10 "$@"
`;

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
      if (text.includes(RENDERERS_OWN) || (this.serverIsAway && NOBODY_THERE.test(text))) return;
      this.complaints.push(`${message.type()}: ${text} (${message.location().url})`);
    });
    page.on("pageerror", (error) => this.complaints.push(`uncaught: ${error.message}`));
  }

  static async open(browser: Browser, url: string): Promise<WatchedPage> {
    const context = await browser.newContext({ viewport: VIEWPORT, colorScheme: "light", reducedMotion: "reduce" });
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

  /** The picture of the clay, without what is written over it, once it stands still. */
  async pictureAtRest(): Promise<Buffer> {
    let last = await this.picture();
    return until("the picture stands still", async () => {
      const next = await this.picture();
      if (await this.share(last, next) === 0) return next;
      last = next;
      return undefined;
    });
  }

  async picture(): Promise<Buffer> {
    const box = await this.page.getByTestId("clay").boundingBox();
    if (box === null) throw new Error("the clay is not on the page");
    return this.page.screenshot({ clip: box, style: ".clay > :not(canvas) { visibility: hidden }" });
  }

  /** Share of pixels, 0 … 1, that differ clearly between two pictures. */
  share(a: Buffer, b: Buffer): Promise<number> {
    return this.#bench.evaluate(shareThatDiffers, [a.toString("base64"), b.toString("base64")]);
  }

  async keep(name: string): Promise<void> {
    await this.page.screenshot({ path: join(OUT, `${name}.png`) });
  }
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
