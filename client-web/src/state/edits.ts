// What the person at the page has asked for and the server has not yet confirmed.
//
// A control shows the wish while it is under way, and the server's own value at all other times; a refusal is shown
// beside the control, with the server's words, and the control goes back. One request is under way at a time; while a
// slider moves, wishes that were overtaken are never sent.

import { signal, type Signal } from "@preact/signals-core";
import type { SessionPatch } from "../protocol/session";
import type { Outcome } from "./api";
import type { Platform } from "./platform";

/** JSON pointers of the settings that can be changed, each with its type. */
export interface Settings {
  "/scheme": NonNullable<SessionPatch["scheme"]>;
  "/paused": boolean;
  "/material/viscosity_pa_s_per_m": number;
  "/material/yield_stress_pa": number;
  "/material/stiffness_pa": number;
  "/network/up/delay_s": number;
  "/network/up/jitter_s": number;
  "/network/up/loss": number;
  "/network/down/delay_s": number;
  "/network/down/jitter_s": number;
  "/network/down/loss": number;
  "/deadband": number;
  "/operation": NonNullable<SessionPatch["operation"]>;
}
export type Pointer = keyof Settings;
export type NumberPointer = { [P in Pointer]: Settings[P] extends number ? P : never }[Pointer];
export type Changes = { readonly [P in Pointer]?: Settings[P] };

export type Edit =
  | { readonly name: "settled" }
  | { readonly name: "wished"; readonly value: Settings[Pointer] }
  | { readonly name: "refused"; readonly detail: string };

const SETTLED: Edit = { name: "settled" };
/** Changes are gathered this long: sixteen a second is as good as continuous to a hand on a slider. */
const GATHER_MS = 60;

export class Edits {
  readonly #send: (patch: SessionPatch) => Promise<Outcome>;
  readonly #after: Platform["after"];
  readonly #fields = new Map<Pointer, Signal<Edit>>();
  readonly #wishes = new Map<Pointer, Settings[Pointer]>();
  #underWay = false;

  constructor(after: Platform["after"], send: (patch: SessionPatch) => Promise<Outcome>) {
    this.#after = after;
    this.#send = send;
  }

  /** Where a setting stands. */
  of(pointer: Pointer): Signal<Edit> {
    let field = this.#fields.get(pointer);
    if (field === undefined) {
      field = signal<Edit>(SETTLED);
      this.#fields.set(pointer, field);
    }
    return field;
  }

  wish(changes: Changes): void {
    for (const [pointer, value] of entries(changes)) {
      this.#wishes.set(pointer, value);
      this.of(pointer).value = { name: "wished", value };
    }
    if (this.#underWay) return;
    this.#underWay = true;
    this.#after(GATHER_MS, () => void this.#flush());
  }

  /** Forgets every wish and refusal: another session, or a server that came back. */
  forget(): void {
    this.#wishes.clear();
    for (const field of this.#fields.values()) field.value = SETTLED;
  }

  async #flush(): Promise<void> {
    while (0 < this.#wishes.size) {
      const sent = new Map(this.#wishes);
      this.#wishes.clear();
      this.#settle(sent, await this.#send(patchOf(sent)));
    }
    this.#underWay = false;
  }

  #settle(sent: Map<Pointer, Settings[Pointer]>, outcome: Outcome): void {
    const refusal = outcome.kind === "done" ? undefined : refusalOf(sent, outcome);
    for (const pointer of sent.keys()) {
      if (this.#wishes.has(pointer)) continue; // wished again meanwhile: the answer to that one counts
      this.of(pointer).value = refusal?.pointer === pointer ? { name: "refused", detail: refusal.detail } : SETTLED;
    }
  }
}

/** Which field to show a refusal at: the one it points at, or the first of those sent. */
function refusalOf(
  sent: Map<Pointer, Settings[Pointer]>,
  outcome: Exclude<Outcome, { kind: "done" }>,
): { pointer: Pointer | undefined; detail: string } {
  const pointers = [...sent.keys()];
  if (outcome.kind === "away") return { pointer: pointers[0], detail: "the server did not answer" };
  const { pointer: at, detail } = outcome.problem;
  return { pointer: pointers.find((pointer) => pointer === at) ?? pointers[0], detail };
}

/** `{"/network/up/loss": 0.1}` as `{network: {up: {loss: 0.1}}}`. */
export function patchOf(changes: ReadonlyMap<Pointer, Settings[Pointer]>): SessionPatch {
  const patch: Tree = {};
  for (const [pointer, value] of changes) {
    const path = pointer.split("/").slice(1);
    let at = patch;
    for (const key of path.slice(0, -1)) {
      const next = at[key];
      at = typeof next === "object" ? next : (at[key] = {});
    }
    at[path[path.length - 1]] = value;
  }
  return patch;
}

interface Tree {
  [key: string]: Tree | Settings[Pointer];
}

function entries(changes: Changes): [Pointer, Settings[Pointer]][] {
  const found: [Pointer, Settings[Pointer]][] = [];
  for (const pointer of POINTERS) {
    const value = changes[pointer];
    if (value !== undefined) found.push([pointer, value]);
  }
  return found;
}

/** Every one of them, in the order in which they are sent. */
const EVERY: Readonly<Record<Pointer, true>> = {
  "/scheme": true, "/paused": true, "/deadband": true, "/operation": true,
  "/material/viscosity_pa_s_per_m": true, "/material/yield_stress_pa": true, "/material/stiffness_pa": true,
  "/network/up/delay_s": true, "/network/up/jitter_s": true, "/network/up/loss": true,
  "/network/down/delay_s": true, "/network/down/jitter_s": true, "/network/down/loss": true,
};
const POINTERS = Object.keys(EVERY).filter((name): name is Pointer => name in EVERY);
