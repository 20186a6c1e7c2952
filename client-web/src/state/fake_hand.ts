// A worker for tests: what the page told it, and what the test has it tell.

import type { FromHand, ToHand } from "../hand/port";
import type { HandState } from "../protocol/hand_module";
import type { HandPort } from "./conversation";

export class FakeHand implements HandPort {
  readonly told: ToHand[] = [];
  readonly sockets: string[] = [];
  hasEnded = false;

  connect(session: string): void {
    this.sockets.push(session);
  }

  post(message: ToHand): void {
    this.told.push(message);
  }

  end(): void {
    this.hasEnded = true;
  }

  /** What was sent to the server, newest last. */
  get asked(): unknown[] {
    return this.told.flatMap((message): unknown[] => (message.type === "text" ? [JSON.parse(message.text)] : []));
  }

  /** Kinds of what the worker was told beside texts. */
  get orders(): ToHand["type"][] {
    return this.told.map(({ type }) => type).filter((type) => type !== "text");
  }

  forget(): void {
    this.told.length = 0;
  }
}

export const text = (message: unknown): FromHand => ({ type: "text", text: JSON.stringify(message) });

export function grantText(change: { readonly lease?: number; readonly tool?: number } = {}): unknown {
  return {
    type: "granted",
    keys: "07".repeat(32) + "0b".repeat(32),
    granted: {
      lease: 1, tool: 1, node: "lab", lease_s: 10, ownership_epoch: 1,
      parameters: { revision: 3, axes: 2 }, clay: { epoch: 1, revision: 0 }, ...change,
    },
  };
}

const COUNTS = {
  ticks: 0, given_up: 0, gaps: 0, guarded: 0, sent: 0, stale: 0, unheard: 0, undecodable: 0, foreign: 0, overflowed: 0,
};

export function fakeHandState(change: Partial<HandState> = {}): HandState {
  return {
    at_ms: 0, mode: "coupled", link: "live", grasp: "released", scheme: "replica", copy: "live",
    hand_m: [0, 0, 0], handle_m: [0, 0, 0], tool_m: [0, 0, 0], felt_force_n: [0, 0, 0], hand_force_n: [0, 0, 0], device_force_n: [0, 0, 0],
    clay_hash: undefined, clay_epoch: 1, round_trip_s: undefined, silence_s: 0,
    corrections: { count: 0, largest_step_n: 0, held_n: 0 }, counts: COUNTS,
    wanted: { parameters: false, lease: false, snapshot: undefined },
    ...change,
  };
}

export function fakeCounts(change: Partial<HandState["counts"]>): HandState["counts"] {
  return { ...COUNTS, ...change };
}

export function stateOf(state: HandState, unsent = 0): FromHand {
  return { type: "state", state, pace: { how: "timers", most_ticks: 4, unsent } };
}
