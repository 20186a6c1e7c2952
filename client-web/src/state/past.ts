// The clay as it was at another moment: asked of the server while somebody looks for one, and only the newest wish
// counts.

import { batch, signal, type ReadonlySignal } from "@preact/signals-core";
import { saidIn } from "./api";
import type { Platform } from "./platform";

export type Moment =
  | { readonly name: "now" }
  /** On its way; what is on show is older. */
  | { readonly name: "asked"; readonly at_s: number }
  | { readonly name: "shown"; readonly at_s: number }
  /** It cannot be shown, and why. */
  | { readonly name: "refused"; readonly at_s: number; readonly because: string };

/**
 * Wishes are gathered this long, ms. Each costs the server a replay, so a hand on the time line is answered a few times
 * a second, and not at each of its moves.
 */
const GATHER_MS = 150;
/**
 * A server that has enough large answers under way says so, perhaps on account of wishes that were given up just now:
 * then it is asked again, so often and this far apart, ms.
 */
const BUSY = 503;
const BUSY_TRIES = 8;
const BUSY_MS = 400;
const NOW: Moment = { name: "now" };

/** `Shown`: what becomes of a file. */
export class Past<Shown> {
  readonly #platform: Platform;
  readonly #pathAt: (at_s: number) => string | undefined;
  readonly #read: (bytes: ArrayBuffer) => Promise<Shown>;
  readonly #moment = signal<Moment>(NOW);
  readonly #clay = signal<Shown | undefined>(undefined);
  /** Of the wish under way. */
  #abort = new AbortController();
  #isGathering = false;
  #cancel: () => void = () => undefined;

  /** `pathAt`: where the clay of a moment is; nothing while there is no session. `read` throws what is no clay. */
  constructor(platform: Platform, pathAt: (at_s: number) => string | undefined, read: (bytes: ArrayBuffer) => Promise<Shown>) {
    this.#platform = platform;
    this.#pathAt = pathAt;
    this.#read = read;
  }

  get moment(): ReadonlySignal<Moment> {
    return this.#moment;
  }

  /** The clay of the newest wish that was answered; nothing while now is on show. */
  get clay(): ReadonlySignal<Shown | undefined> {
    return this.#clay;
  }

  show(at_s: number): void {
    this.#moment.value = { name: "asked", at_s };
    if (this.#isGathering) return;
    this.#isGathering = true;
    this.#cancel = this.#platform.after(GATHER_MS, () => void this.#ask());
  }

  backToNow(): void {
    this.#cancel();
    this.#isGathering = false;
    this.#abort.abort();
    batch(() => {
      this.#moment.value = NOW;
      this.#clay.value = undefined;
    });
  }

  async #ask(): Promise<void> {
    this.#isGathering = false;
    const moment = this.#moment.peek();
    if (moment.name !== "asked") return;
    this.#abort.abort();
    const abort = new AbortController();
    this.#abort = abort;
    const found = await this.#clayAt(moment.at_s, abort.signal);
    if (abort.signal.aborted) return;
    batch(() => {
      // What cannot be shown leaves now on show, and not some other moment.
      this.#clay.value = typeof found === "string" ? undefined : found.clay;
      // Another moment may have been wished meanwhile: this one is still nearer to it than what was on show.
      if (this.#isGathering) return;
      this.#moment.value = typeof found === "string"
        ? { name: "refused", at_s: moment.at_s, because: found }
        : { name: "shown", at_s: moment.at_s };
    });
  }

  /** The clay, or why there is none. */
  async #clayAt(at_s: number, signal: AbortSignal): Promise<{ readonly clay: Shown } | string> {
    const path = this.#pathAt(at_s);
    if (path === undefined) return "there is no session";
    let loaded;
    try {
      loaded = await this.#platform.load(path, signal);
      for (let tries = 1; loaded.status === BUSY && tries < BUSY_TRIES && !signal.aborted; tries += 1) {
        await new Promise<void>((resolve) => this.#platform.after(BUSY_MS, resolve));
        signal.throwIfAborted();
        loaded = await this.#platform.load(path, signal);
      }
    } catch {
      return "the server did not answer";
    }
    const { status, bytes } = loaded;
    if (status !== 200) return saidIn({ status, body: new TextDecoder().decode(bytes) }).detail;
    try {
      return { clay: await this.#read(bytes) };
    } catch (error) {
      return `the answer is not understood: ${error instanceof Error ? error.message : String(error)}`;
    }
  }
}
