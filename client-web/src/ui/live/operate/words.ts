// What is to be said to whoever operates: why nothing moves, why little is felt, who took the tool away.

import type { Session } from "../../../protocol/session";
import type { Because, Standing } from "../../../state/conversation";
import type { Hand, LetGo } from "../../../state/operating";

export interface Line {
  /** For tests, and to tell one line from another. */
  readonly key: string;
  readonly level: "good" | "warn" | "bad";
  readonly says: string;
}

/** Why there is no tool here (any more). */
export function saidOf(because: Because): Line {
  switch (because.kind) {
    case "refused": {
      const holder = because.holder === undefined || because.reason.includes(because.holder) ? "" : ` (${because.holder})`;
      return { key: `refused-${because.code}`, level: "bad", says: `The server gives no tool: ${sentence(because.reason)}${holder}` };
    }
    case "farewell":
      return { key: "farewell", level: "bad", says: `The tool was taken away: ${sentence(because.reason)} Nothing here moves it any more.` };
    case "trouble":
      return { key: "trouble", level: "bad", says: `No tool is held here: ${sentence(because.reason)}` };
  }
}

const LET_GO: Record<Exclude<LetGo["kind"], "limit">, string> = {
  hidden: "The page was out of sight, where no browser tells of a hand in time: the hand was let go of.",
  gap: "The loop in this page stood still for a while: the hand was let go of.",
  lease: "The lease was lost: the hand was let go of.",
  anew: "The session's loop is another one now: the hand was let go of, and the handle is at its home.",
};

/** What is amiss or worth knowing while a tool is held, the gravest first. */
export function linesOf(standing: Standing, hand: Hand | undefined, letGo: LetGo | undefined): Line[] {
  if (standing.name === "again") {
    return [{ key: "again", level: "bad", says: `The lease is lost: ${standing.because}. Asking for another${standing.attempts < 2 ? "" : `, for the ${standing.attempts}th time`}.` }];
  }
  if (standing.name !== "in") return [];
  const lines: Line[] = [];
  if (letGo !== undefined) {
    const why = letGo.kind === "limit" ? `More was felt than the limit, ${letGo.felt_n.toFixed(1)} N: the hand was let go of.` : LET_GO[letGo.kind];
    lines.push({ key: `let-go-${letGo.kind}`, level: "warn", says: `${why} Take hold anew to go on.` });
  }
  if (hand === undefined) return lines;
  const line = (key: string, level: Line["level"], says: string): void => {
    lines.push({ key, level, says });
  };
  const { state } = hand;
  if (state.link === "fault") line("fault", "bad", "The loop is in fault: the handle comes to rest, and nothing moves it. Release the tool and take it anew.");
  else if (state.mode !== "coupled") line("rest", "warn", "The handle is being brought to rest.");
  linkLine(state, line);
  if (state.copy === "diverged") line("diverged", "warn", "The copy of the clay differs from the server's: the parts that differ are on their way.");
  if (hand.isGuarded) line("guarded", "warn", "A limiter acts: the device's own law for force, slew and speed holds the hand back.");
  if (hand.isUnsent) line("unsent", "warn", "The line is full: what the hand does reaches the server late or not at all.");
  if (state.grasp === "waiting") line("waiting", "warn", "The hand waits: it takes hold as soon as the pointer is heard of in time.");
  return lines;
}

function linkLine(state: Hand["state"], line: (key: string, level: Line["level"], says: string) => void): void {
  switch (state.link) {
    case "not_yet": line("not-yet", "warn", "No frame has come from the server yet: nothing is felt."); break;
    case "silent": line("silent", "bad", `The link is silent for ${state.silence_s.toFixed(1)} s: what was felt has faded to nothing.`); break;
    case "on_stale_copy": line("stale", "warn", "No news for too long: the copy is stale; it is felt, and cut no longer."); break;
    case "gone": line("gone", "bad", "The server has gone: nothing is felt."); break;
    case "paused": line("paused", "warn", "The session is paused: nothing is felt, and the tool rests."); break;
    case "live": case "on_copy": case "fault": break;
  }
}

/** Who stopped a session, and why. */
export function stopWords(stop: NonNullable<Session["stop"]>): string {
  const by = stop.by === "" ? "Somebody" : `${stop.by.charAt(0).toUpperCase()}${stop.by.slice(1)}`;
  return stop.reason === "" ? `${by} has stopped the session.` : `${by} has stopped the session: ${sentence(stop.reason)}`;
}

const GRASPS: Record<Hand["state"]["grasp"], string> = {
  released: "let go: nothing moves",
  waiting: "waits for the pointer",
  held: "held",
  letting_go: "letting go",
  clutched: "clutch out: the hand moves alone",
  stopped: "let go, for the force was too great",
};

export const graspWords = (grasp: Hand["state"]["grasp"]): string => GRASPS[grasp];

function sentence(text: string): string {
  return /[.!?]$/.test(text) ? text : `${text}.`;
}
