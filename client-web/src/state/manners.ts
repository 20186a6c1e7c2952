// Who may do what with each tool, as one page sees it: from the session's state, who sits here, and what this page
// holds.

import type { Session } from "../protocol/session";

/** Who sits at this page. */
export interface Me {
  /** As others see it; empty while nobody has said. */
  readonly name: string;
  /** The tool that this page holds. */
  readonly tool: number | undefined;
}

export type Holding =
  | { readonly name: "free" }
  /** Kept for a moment, since its holder has handed it over. */
  | { readonly name: "kept"; readonly operator: string; readonly isForMe: boolean }
  | { readonly name: "mine"; readonly operator: string }
  /** `isSilent`: no frames come, and the server gives it to the next who asks. */
  | { readonly name: "held"; readonly operator: string; readonly isSilent: boolean };

export interface ToolRow {
  readonly id: number;
  readonly holding: Holding;
  /** Who has asked for it, the first one first. */
  readonly requests: readonly string[];
  readonly request: "may" | "asked" | "no";
  /** Whether those who asked can be answered here. */
  readonly answers: boolean;
}

export function toolRows(session: Session, me: Me): ToolRow[] {
  return session.tools.map(({ id, operator, connected, requests, reserved_for }) => {
    const holding = holdingOf(id, operator, connected, reserved_for, me);
    return { id, holding, requests, request: requestOf(session, holding, requests, me), answers: holding.name === "mine" };
  });
}

/** Why nobody can take a tool here now, in a sentence; nothing when somebody can. */
export function hindrance(session: Session, rows: readonly ToolRow[]): string | undefined {
  if (session.state === "stopped") return "The session is stopped: nobody holds a tool until that is cleared.";
  const canBeHad = rows.some(({ holding }) =>
    holding.name === "free" || (holding.name === "held" && holding.isSilent) || (holding.name === "kept" && holding.isForMe));
  if (canBeHad) return undefined;
  return rows.length === 1 ? "The tool is held: its holder can be asked for it." : "Every tool is held: a holder can be asked for one.";
}

function holdingOf(id: number, operator: string, connected: boolean, reserved: string | null, me: Me): Holding {
  if (id === me.tool) return { name: "mine", operator: operator === "" ? me.name : operator };
  if (operator !== "") return { name: "held", operator, isSilent: !connected };
  if (reserved !== null) return { name: "kept", operator: reserved, isForMe: reserved === me.name };
  return { name: "free" };
}

function requestOf(session: Session, holding: Holding, requests: readonly string[], me: Me): ToolRow["request"] {
  if (holding.name !== "held" || session.state === "stopped") return "no";
  if (me.name !== "" && requests.includes(me.name)) return "asked";
  return me.tool === undefined ? "may" : "no";
}
