// The story in three steps: a crisp loop, the same loop under delay, and the replica under the same delay. Which step
// the session is in is read off the session, whoever brought it there; what each step came to is measured on the way.

import { signal } from "@preact/signals";
import type { Scheme, Session } from "../../protocol/session";
import { Channel } from "../../protocol/telemetry";
import type { Changes } from "../../state/edits";
import type { History } from "../../state/history";
import { swingOf } from "./unrest";

export const STEPS = ["crisp", "late", "replica"] as const;
export type Step = (typeof STEPS)[number];

/** One way, s: 300 ms there and back. */
export const DELAY_S = 0.15;
/** A line that nobody notices, and one that everybody does, s one way. */
const SHORT_S = 0.01;
const LONG_S = 0.05;

/** Firm enough that a late answer has force: the demo's own clay is too soft to shake a hand. */
const CLAY: Changes = { "/material/viscosity_pa_s_per_m": 1.2e6, "/material/yield_stress_pa": 0, "/material/stiffness_pa": 0 };

const SETTINGS: Record<Step, { readonly scheme: Scheme; readonly delay_s: number }> = {
  crisp: { scheme: "position_force", delay_s: 0 },
  late: { scheme: "position_force", delay_s: DELAY_S },
  replica: { scheme: "replica", delay_s: DELAY_S },
};

/** What brings a session to a step. */
export function changesFor(step: Step): Changes {
  const { scheme, delay_s } = SETTINGS[step];
  return {
    ...CLAY, "/scheme": scheme,
    "/network/up/delay_s": delay_s, "/network/down/delay_s": delay_s,
    "/network/up/jitter_s": 0, "/network/down/jitter_s": 0, "/network/up/loss": 0, "/network/down/loss": 0,
  };
}

/** What puts everything back that the story changes. */
export function changesBackTo({ scheme, material, network: { up, down } }: Session): Changes {
  return {
    "/scheme": scheme,
    "/material/viscosity_pa_s_per_m": material.viscosity_pa_s_per_m,
    "/material/yield_stress_pa": material.yield_stress_pa,
    "/material/stiffness_pa": material.stiffness_pa,
    "/network/up/delay_s": up.delay_s, "/network/up/jitter_s": up.jitter_s, "/network/up/loss": up.loss,
    "/network/down/delay_s": down.delay_s, "/network/down/jitter_s": down.jitter_s, "/network/down/loss": down.loss,
  };
}

/** The step that a session is in; nothing for any other session. */
export function stepOf({ scheme, material, network: { up, down } }: Session): Step | undefined {
  if (material.viscosity_pa_s_per_m < 1e6) return undefined;
  const round_trip_s = up.delay_s + down.delay_s;
  const isLong = 2 * LONG_S <= round_trip_s;
  if (scheme === "replica" && isLong) return "replica";
  if (scheme !== "position_force") return undefined;
  return isLong ? "late" : round_trip_s <= 2 * SHORT_S ? "crisp" : undefined;
}

/** What a step came to: how far the felt force and the hand's velocity swing. */
export interface Outcome {
  readonly felt_n: number;
  readonly velocity_m_s: number;
}

/** Over the last seconds of a step, once what came before has died away. */
const SPAN_S = 6;
const SETTLE_S = 2;
const STEP_S = 0.005;

export const outcomes = signal<Partial<Record<Step, Outcome>>>({});

/** Follows a session through the steps. */
export class StoryWatch {
  #step: Step | undefined;
  #since_s = 0;

  /** Looks at the session as it is at `time_s`, its own time. */
  look(session: Session, history: History, time_s: number): void {
    const step = stepOf(session);
    if (step !== this.#step || time_s < this.#since_s) {
      this.#step = step;
      this.#since_s = time_s;
    }
    if (step === undefined || session.state !== "running") return;
    const span_s = Math.min(time_s - this.#since_s - SETTLE_S, SPAN_S);
    if (span_s < SPAN_S / 2) return;
    const measured = (channel: number): number | undefined => swingOf(history.path(channel, time_s, span_s, STEP_S), STEP_S);
    const felt_n = measured(Channel.felt_force_n);
    const velocity_m_s = measured(Channel.handle_velocity_m_s);
    if (felt_n === undefined || velocity_m_s === undefined) return;
    outcomes.value = { ...outcomes.peek(), [step]: { felt_n, velocity_m_s } };
  }
}
