// A session as a server would tell it, for tests.

import type { Impairment, Session } from "../protocol/session";

export function fakeSession(change: Partial<Session> = {}): Session {
  const impairment: Impairment = { delay_s: 0, jitter_s: 0, loss: 0, seed: 1, jitter_distribution: "normal", duplicate: 0, reorder: 0 };
  return {
    id: "demo",
    revision: 0,
    scheme: "replica",
    axes: 2,
    state: "running",
    fault: null,
    stop: null,
    material: { viscosity_pa_s_per_m: 2e5, yield_stress_pa: 0, stiffness_pa: 0 },
    network: { up: { ...impairment }, down: { ...impairment } },
    clay: {
      voxel_size_m: 5e-4, initial_volume_m3: 5e-4, remaining_volume_m3: 5e-4, removed_volume_m3: 0,
      initial_units: 1000, remaining_units: 1000, removed_units: 0, unit_volume_m3: 5e-7,
      hash: "0123456789abcdef", shape: { kind: "block", size_m: [0.128, 0.064, 0.064] }, epoch: 1,
    },
    tool: { kind: "ball", radius_m: 0.0064 },
    operation: "cut",
    deadband: 0,
    tools: [{
      id: 1, operator: "Ada", connected: true, requests: [], reserved_for: null, position_m: [0, 0, 0], force_n: [0, 0, 0], handle_position_m: [0, 0, 0],
      felt_force_n: [0, 0, 0], hand_force_n: [0, 0, 0], home_m: [0, 0, 0], copy: "none", hidden_force_n: [0, 0, 0], sweeps_refused: 0, refusal: "none",
      sweeps_acknowledged: 0, sweeps_durable: 0,
      corrections: { count: 0, moved_n: 0, held_n: [0, 0, 0], largest_step_n: 0, injected_j: 0, tank_j: 0 },
    }],
    position_ratio: 1,
    coordination_m: 0,
    storage: { state: "durable", durable_revision: 0, bytes: 0, reason: null },
    loop: {
      rate_hz: 1000, ticks: 0, late_ticks: 0, tick_s: { p50: 0, p99: 0, p999: 0, max: 0 },
      thread: 0, own_tick_s: { p50: 0, p99: 0, p999: 0, max: 0 }, budget_share: 0, rtt_s: { p50: 0, p99: 0 },
      age_s: { p50: 0, p99: 0 }, lost: 0, duplicates: 0, reordered: 0, unheard: 0, packets_up_per_s: 1000, packets_down_per_s: 1000,
      energy_j: 0, scheduler: "SCHED_OTHER",
    },
    ...change,
  };
}
