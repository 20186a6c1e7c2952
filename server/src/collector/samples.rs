//! What watchers plot: a sample of each tool, at the rate of the session's records.

use teleclay_proto::watch::TelemetrySample;

use crate::engine::{RECORD_EVERY, SessionRecord, TICK, ToolRecord};
use crate::session::SessionShared;

/// Hands the samples of one tick to whoever watches.
pub(super) fn publish(shared: &SessionShared, before: &SessionRecord, record: &SessionRecord) {
    let time_s = record.ticks as f64 * TICK.as_secs_f64();
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    for (slot, tool) in record.tools.iter().enumerate() {
        let Some(tool) = tool else { continue };
        let view = &tool.view;
        let before = before.tools[slot].filter(|before| before.lease == tool.lease);
        let sample = TelemetrySample {
            hand_force_n: single(view.hand_force_n),
            felt_force_n: single(view.felt_force_n),
            tool_force_n: single(view.force_n),
            handle_position_m: single(view.handle_position_m),
            tool_position_m: single(view.position_m),
            handle_velocity_m_s: single(view.handle_velocity_m_s),
            tool_velocity_m_s: single(view.velocity_m_s),
            energy_handle_j: view.energy_handle_j as f32,
            // What the tool puts into the clay has left the link.
            energy_tool_j: -view.energy_tool_j as f32,
            rtt_s: tool.rtt_s.unwrap_or(0.0) as f32,
            correction_step_n: corrected_since(before.as_ref(), tool) as f32,
            correction_held_n: norm(view.corrections.held_n),
            age_s: tool.silence_s as f32,
        };
        shared.publish(
            slot,
            time_s,
            TICK.as_micros() as u32 * RECORD_EVERY as u32,
            sample,
        );
    }
}

fn norm([x, y, z]: [f32; 3]) -> f32 {
    x.hypot(y).hypot(z)
}

/// How far corrections have moved the force on this hand since the record before, N.
fn corrected_since(before: Option<&ToolRecord>, tool: &ToolRecord) -> f64 {
    let moved_n = tool.view.corrections.moved_n;
    let since_n = moved_n - before.map_or(0.0, |before| before.view.corrections.moved_n);
    // A copy that was made anew counts from zero.
    if since_n < 0.0 { moved_n } else { since_n }
}
