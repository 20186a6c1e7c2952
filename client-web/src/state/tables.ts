// The latency table on show: the one that came with this page, or one from a file.

import { signal, type ReadonlySignal } from "@preact/signals-core";
import type { LatencyTable } from "../protocol/latency";
import { decodeLatencyTable } from "../protocol/text";
import type { Platform } from "./platform";

export type TableState =
  | { readonly name: "looking" }
  /** There is none, and why. */
  | { readonly name: "none"; readonly reason: string }
  | { readonly name: "shown"; readonly table: LatencyTable; readonly origin: string };

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

  /** Takes the published table, unless one is on show. */
  async look(): Promise<void> {
    if (this.#isShown()) return;
    this.#state.value = { name: "looking" };
    const found = await this.#takePublished();
    // A file may have been opened meanwhile.
    if (!this.#isShown()) this.#state.value = found;
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

  async #takePublished(): Promise<TableState> {
    if (this.#published === undefined) return { name: "none", reason: "This page came without a table." };
    try {
      const { status, body } = await this.#platform.request("GET", this.#published);
      if (status === 200) return { name: "shown", table: decodeLatencyTable(body), origin: "published with this page" };
      return { name: "none", reason: `The table of this page cannot be had: status ${status}.` };
    } catch (error) {
      return { name: "none", reason: `The table of this page cannot be read: ${error instanceof Error ? error.message : String(error)}` };
    }
  }
}
