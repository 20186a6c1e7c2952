// The latency table on show: the server's, the one that came with this page, or one from a file.

import { signal, type ReadonlySignal } from "@preact/signals-core";
import type { LatencyTable } from "../protocol/latency";
import { decodeCalls, decodeLatencyTable, decodeProblem } from "../protocol/text";
import { API } from "./connection";
import type { Platform } from "./platform";

export type TableState =
  | { readonly name: "looking" }
  /** There is none, and why. */
  | { readonly name: "none"; readonly reason: string }
  | { readonly name: "shown"; readonly table: LatencyTable; readonly origin: string };

const PATH = `${API}/latency-table`;

export class Tables {
  readonly #platform: Platform;
  readonly #published: string | undefined;
  readonly #state = signal<TableState>({ name: "looking" });
  /** What was wrong with the last file; the table before it stays. */
  readonly #refusal = signal<string | undefined>(undefined);

  /** `published`: where the table that came with this page lies; nothing when none did. */
  constructor(platform: Platform, published?: string) {
    this.#platform = platform;
    this.#published = published;
  }

  get state(): ReadonlySignal<TableState> {
    return this.#state;
  }

  get refusal(): ReadonlySignal<string | undefined> {
    return this.#refusal;
  }

  /** Asks the server for its table, or takes the published one, unless one is on show. */
  async look(): Promise<void> {
    if (this.#state.peek().name === "shown") return;
    this.#state.value = { name: "looking" };
    const found = await this.#ask();
    const best = found.name === "shown" ? found : ((await this.#takePublished()) ?? found);
    if (!this.#isShown()) this.#state.value = best;
  }

  /** Shows the table in a file's text. */
  read(text: string, name: string): void {
    try {
      this.#state.value = { name: "shown", table: decodeLatencyTable(text), origin: name };
      this.#refusal.value = undefined;
    } catch (error) {
      this.#refusal.value = `${name} is no latency table: ${error instanceof Error ? error.message : String(error)}`;
    }
  }

  #isShown(): boolean {
    return this.#state.peek().name === "shown";
  }

  async #takePublished(): Promise<TableState | undefined> {
    if (this.#published === undefined) return undefined;
    try {
      const answer = await this.#platform.request("GET", this.#published);
      return answer.status === 200 ? { name: "shown", table: decodeLatencyTable(answer.body), origin: "published with this page" } : undefined;
    } catch {
      return undefined; // it says what the server has to say instead
    }
  }

  async #ask(): Promise<TableState> {
    try {
      // A server without tables is not asked for one: browsers log a refusal as an error.
      const calls = await this.#platform.request("GET", `${API}/openapi.json`);
      const offers = calls.status === 200 && decodeCalls(calls.body).some((path) => path.endsWith(PATH));
      if (!offers) return { name: "none", reason: "This server keeps no table." };
      const answer = await this.#platform.request("GET", PATH);
      if (answer.status === 200) return { name: "shown", table: decodeLatencyTable(answer.body), origin: "this server" };
      return { name: "none", reason: decodeProblem(answer.body)?.detail ?? "This server has no table yet." };
    } catch (error) {
      return { name: "none", reason: `The server's table cannot be read: ${error instanceof Error ? error.message : String(error)}` };
    }
  }
}
