// Requests that change something. An answer is the server's new state, a problem it explains, or silence.

import { decodeProblem, decodeSession } from "../protocol/text";
import type { ClayReset, NewSession, Problem, Session, SessionPatch } from "../protocol/session";
import { API } from "./connection";
import type { Platform } from "./platform";

export type Outcome =
  | { readonly kind: "done"; readonly session: Session | undefined }
  | { readonly kind: "problem"; readonly problem: Problem }
  | { readonly kind: "away" };

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

  stlPath(session: string): string {
    return `${this.path(session)}/clay.stl`;
  }

  path(session: string): string {
    return `${API}/sessions/${encodeURIComponent(session)}`;
  }

  async #ask(method: "POST" | "PATCH", path: string, body: unknown): Promise<Outcome> {
    let answer;
    try {
      answer = await this.#platform.request(method, path, body);
    } catch {
      return { kind: "away" };
    }
    if (200 <= answer.status && answer.status < 300) return { kind: "done", session: sessionIn(answer.body) };
    const problem = decodeProblem(answer.body);
    return { kind: "problem", problem: problem ?? unexplained(answer.status) };
  }
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
