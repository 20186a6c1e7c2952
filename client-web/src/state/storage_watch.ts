// Whether the disk keeps up: what is worth saying of it. A session is behind for a moment with every cut, which is
// nobody's concern; one that stays behind is.

import type { Storage } from "../protocol/session";

export type StorageNews = "fine" | "behind" | "failed" | "ephemeral";

/** What is behind for longer is told, ms: two whole seconds would be lost with the power. */
const PATIENCE_MS = 2000;

export class StorageWatch {
  #behind_since_ms: number | undefined;

  /** Looks at the state at `now_ms`. */
  look(state: Storage["state"], now_ms: number): StorageNews {
    this.#behind_since_ms = state === "behind" ? (this.#behind_since_ms ?? now_ms) : undefined;
    if (state === "failed" || state === "ephemeral") return state;
    return this.#behind_since_ms !== undefined && PATIENCE_MS < now_ms - this.#behind_since_ms ? "behind" : "fine";
  }
}
