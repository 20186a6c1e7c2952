// What becomes of a tool that somebody at this page has asked its holder for.

import type { ToolRow } from "./manners";

export type AskEnd =
  /** It is kept for whoever asked, for a moment. */
  | "given"
  /** It is free, or another's: there is nobody to answer any more. */
  | "gone"
  /** Denied, or forgotten after a while; the events say which. */
  | "ended";

export class Asking {
  #tool: number | undefined;
  /** The server has the request. */
  #isSeen = false;

  get tool(): number | undefined {
    return this.#tool;
  }

  ask(tool: number): void {
    this.#tool = tool;
    this.#isSeen = false;
  }

  forget(): void {
    this.#tool = undefined;
  }

  /** Looks at the tools as they are now; what has become of the request, once. */
  look(rows: readonly ToolRow[]): AskEnd | undefined {
    if (this.#tool === undefined) return undefined;
    const row = rows.find(({ id }) => id === this.#tool);
    const end = row === undefined ? "gone" : this.#endOf(row);
    if (end !== undefined) this.#tool = undefined;
    return end;
  }

  #endOf({ holding, request }: ToolRow): AskEnd | undefined {
    switch (holding.name) {
      case "kept": return holding.isForMe ? "given" : "gone";
      case "free": return this.#isSeen ? "gone" : undefined;
      case "mine": return "gone";
      case "held": {
        const wasSeen = this.#isSeen;
        this.#isSeen ||= request === "asked";
        return wasSeen && request !== "asked" ? "ended" : undefined;
      }
    }
  }
}
