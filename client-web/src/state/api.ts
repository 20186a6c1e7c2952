// Requests that change something. An answer is the server's new state, a problem it explains, or silence.

import { decodeProblem, decodeSession } from "../protocol/text";
import type { ClayReset, NewSession, Problem, Session, SessionPatch } from "../protocol/session";
import type { Redo, Undo } from "../protocol/strokes";
import { API } from "./connection";
import type { Answer, Platform, Upload } from "./platform";

export type Outcome =
  | { readonly kind: "done"; readonly session: Session | undefined }
  | { readonly kind: "problem"; readonly problem: Problem }
  | { readonly kind: "away" };

export type ClayFormat = "stl" | "3mf" | "glb";

/** A file of tens of megabytes takes its time, and so does making clay of it. */
const UPLOAD_MS = 120_000;

export class Api {
  readonly #platform: Platform;

  constructor(platform: Platform) {
    this.#platform = platform;
  }

  patch(session: string, change: SessionPatch): Promise<Outcome> {
    return this.#ask("PATCH", this.path(session), change);
  }

  reset(session: string, fresh: ClayReset): Promise<Outcome> {
    return this.#ask("POST", `${this.path(session)}/clay/reset`, fresh);
  }

  /** Whatever is left out of the session has its default. */
  create(session: NewSession): Promise<Outcome> {
    return this.#ask("POST", `${API}/sessions`, session);
  }

  /** Another session, named `id`, with the clay and the settings of this one. */
  duplicate(session: string, id: string): Promise<Outcome> {
    return this.#ask("POST", `${this.path(session)}/duplicate`, { id });
  }

  remove(session: string): Promise<Outcome> {
    return this.#ask("DELETE", this.path(session));
  }

  undo(session: string, which: Undo): Promise<Outcome> {
    return this.#ask("POST", `${this.path(session)}/undo`, which);
  }

  redo(session: string, which: Redo): Promise<Outcome> {
    return this.#ask("POST", `${this.path(session)}/redo`, which);
  }

  /** Asks the holder of a tool for it. */
  request(session: string, tool: number, operator: string): Promise<Outcome> {
    return this.#ask("POST", this.#toolPath(session, tool, "request"), { operator });
  }

  withdraw(session: string, tool: number, operator: string): Promise<Outcome> {
    return this.#ask("POST", this.#toolPath(session, tool, "withdraw"), { operator });
  }

  /** Hands a tool over to one who has asked for it. */
  grant(session: string, tool: number, operator: string): Promise<Outcome> {
    return this.#ask("POST", this.#toolPath(session, tool, "grant"), { operator });
  }

  deny(session: string, tool: number, operator: string): Promise<Outcome> {
    return this.#ask("POST", this.#toolPath(session, tool, "deny"), { operator });
  }

  /** Takes a tool away from whoever holds it. */
  takeAway(session: string, tool: number): Promise<Outcome> {
    return this.#ask("POST", this.#toolPath(session, tool, "release"));
  }

  /** Takes every tool away until the stop is cleared. */
  stop(session: string, operator: string, reason: string): Promise<Outcome> {
    return this.#ask("POST", `${this.path(session)}/stop`, { operator, reason });
  }

  clearStop(session: string, operator: string): Promise<Outcome> {
    return this.#ask("POST", `${this.path(session)}/stop/clear`, { operator });
  }

  /** A fresh block in the shape of a file, made to fit. */
  shape(session: string, upload: Upload): Promise<Outcome> {
    return this.#outcome(() => this.#platform.put(`${this.path(session)}/clay?fit=true`, upload, UPLOAD_MS));
  }

  /** Where the clay is as a file: now, or as it was. */
  clayPath(session: string, format: ClayFormat, at_s?: number): string {
    return `${this.path(session)}/clay.${format}${at_s === undefined ? "" : `?at_s=${at_s}`}`;
  }

  recordingsPath(session: string): string {
    return `${this.path(session)}/recordings`;
  }

  /** Where a recording is as a file. */
  recordingFile(session: string, recording: string): string {
    return `${this.recordingsPath(session)}/${encodeURIComponent(recording)}.mcap`;
  }

  /** Under the name of the moment, with everything, at every tick. */
  record(session: string): Promise<Outcome> {
    return this.#ask("POST", this.recordingsPath(session), {});
  }

  endRecording(session: string, recording: string): Promise<Outcome> {
    return this.#ask("POST", `${this.recordingsPath(session)}/${encodeURIComponent(recording)}/stop`);
  }

  deleteRecording(session: string, recording: string): Promise<Outcome> {
    return this.#ask("DELETE", `${this.recordingsPath(session)}/${encodeURIComponent(recording)}`);
  }

  historyPath(session: string): string {
    return `${this.path(session)}/history`;
  }

  path(session: string): string {
    return `${API}/sessions/${encodeURIComponent(session)}`;
  }

  #toolPath(session: string, tool: number, what: string): string {
    return `${this.path(session)}/tools/${tool}/${what}`;
  }

  #ask(method: "POST" | "PATCH" | "DELETE", path: string, body?: unknown): Promise<Outcome> {
    return this.#outcome(() => this.#platform.request(method, path, body));
  }

  async #outcome(ask: () => Promise<Answer>): Promise<Outcome> {
    let answer;
    try {
      answer = await ask();
    } catch {
      return { kind: "away" };
    }
    if (200 <= answer.status && answer.status < 300) return { kind: "done", session: sessionIn(answer.body) };
    return { kind: "problem", problem: saidIn(answer) };
  }
}

/** Why something was not done, in words; nothing when it was. */
export function refusalOf(outcome: Outcome): string | undefined {
  if (outcome.kind === "done") return undefined;
  return outcome.kind === "away" ? "the server did not answer" : outcome.problem.detail;
}

/** The problem in an answer that is no good one. */
export function saidIn(answer: Answer): Problem {
  return decodeProblem(answer.body) ?? unexplained(answer.status);
}

/** The session in a good answer. Some answers have no body; the next state message tells then. */
function sessionIn(body: string): Session | undefined {
  try {
    return decodeSession(body);
  } catch {
    return undefined;
  }
}

/** A refusal of somebody who does not speak our language, such as a proxy. */
export function unexplained(status: number): Problem {
  return { type: "about:blank", title: "unexplained", status, detail: `the server answered ${status} without saying why` };
}
