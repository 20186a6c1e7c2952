//! Messages as the vectors tell them.

use serde_json::{Value, json};
use teleclay_proto::frame::{Gaps, HandleFrame, Header, Sweeps, ToolFrame};
use teleclay_proto::http::ClayHash;
use teleclay_proto::watch::{BRICK_VOXELS, BrickBody, BricksKind, BricksView, TelemetryView};

/// A handle frame as the vectors tell it.
pub fn handle_frame_value(frame: &HandleFrame) -> Value {
    json!({
        "header": header_value(&frame.header),
        "engagement": frame.engagement.word(),
        "position_m": floats(frame.position_m),
        "velocity_m_s": floats(frame.velocity_m_s),
        "hand_force_n": floats(frame.hand_force_n),
        "felt_force_n": floats(frame.felt_force_n),
        "wave": floats(frame.wave),
        "wave_integral": floats(frame.wave_integral),
        "energy_in_j": floats(frame.energy_in_j),
        "clay_hash": ClayHash(frame.clay_hash).to_string(),
        "relayed_acknowledged": frame.relayed_acknowledged,
        "relayed_gaps": gaps_value(&frame.relayed_gaps),
        "copy": frame.copy.word(),
        "corrections": {
            "moved_n": float(frame.corrections.moved_n),
            "held_n": singles(frame.corrections.held_n),
            "largest_step_n": float(frame.corrections.largest_step_n.into()),
            "injected_j": float(frame.corrections.injected_j.into()),
            "tank_j": float(frame.corrections.tank_j.into()),
            "count": frame.corrections.count,
        },
        "oldest_unacknowledged": frame.sweeps.oldest_unacknowledged,
        "sweeps": sweeps_value(&frame.sweeps),
    })
}

fn gaps_value(gaps: &Gaps) -> Vec<[u16; 2]> {
    gaps.as_slice()
        .iter()
        .map(|gap| [gap.missing, gap.come])
        .collect()
}

fn sweeps_value(sweeps: &Sweeps) -> Vec<Value> {
    sweeps
        .iter()
        .map(|sweep| json!({ "sequence": sweep.sequence, "from": sweep.from, "to": sweep.to }))
        .collect()
}

/// A tool frame as the vectors tell it.
pub fn tool_frame_value(frame: &ToolFrame) -> Value {
    json!({
        "header": header_value(&frame.header),
        "status": frame.status.word(),
        "refusal": frame.refusal.word(),
        "position_m": floats(frame.position_m),
        "velocity_m_s": floats(frame.velocity_m_s),
        "force_n": floats(frame.force_n),
        "wave": floats(frame.wave),
        "wave_integral": floats(frame.wave_integral),
        "energy_in_j": floats(frame.energy_in_j),
        "engaged_area_m2": float(frame.engaged_area_m2),
        "sweeps_acknowledged": frame.sweeps_acknowledged,
        "sweeps_durable": frame.sweeps_durable,
        "epochs_kept": frame.epochs_kept,
        "sweep_gaps": gaps_value(&frame.sweep_gaps),
        "sweeps_refused": frame.sweeps_refused,
        "clay_hash": ClayHash(frame.clay_hash).to_string(),
        "relayed_oldest_unacknowledged": frame.relayed.oldest_unacknowledged,
        "relayed": sweeps_value(&frame.relayed),
    })
}

/// A batch of telemetry as the vectors tell it.
pub fn telemetry_value(view: &TelemetryView<'_>) -> Value {
    let samples: Vec<Value> = view
        .iter()
        .map(|sample| {
            json!({
                "hand_force_n": singles(sample.hand_force_n),
                "felt_force_n": singles(sample.felt_force_n),
                "tool_force_n": singles(sample.tool_force_n),
                "handle_position_m": singles(sample.handle_position_m),
                "tool_position_m": singles(sample.tool_position_m),
                "handle_velocity_m_s": singles(sample.handle_velocity_m_s),
                "tool_velocity_m_s": singles(sample.tool_velocity_m_s),
                "energy_handle_j": float(sample.energy_handle_j.into()),
                "energy_tool_j": float(sample.energy_tool_j.into()),
                "rtt_s": float(sample.rtt_s.into()),
                "correction_step_n": float(sample.correction_step_n.into()),
                "correction_held_n": float(sample.correction_held_n.into()),
                "age_s": float(sample.age_s.into()),
            })
        })
        .collect();
    json!({
        "sequence": view.batch.sequence,
        "tool": view.batch.tool,
        "period_us": view.batch.period_us,
        "dropped": view.batch.dropped,
        "first_time_s": float(view.batch.first_time_s),
        "samples": samples,
    })
}

/// A message of bricks as the vectors tell it. The voxels of packed bricks stand run by run, `[count, occupancy]`.
pub fn bricks_value(view: &BricksView<'_>) -> Value {
    let bricks: Vec<Value> = view
        .iter()
        .map(|brick| match brick.body {
            BrickBody::Empty => json!({ "index": brick.index, "kind": "empty" }),
            BrickBody::Full => json!({ "index": brick.index, "kind": "full" }),
            BrickBody::Packed(packed) => {
                let mut voxels = [0; BRICK_VOXELS];
                packed.unpack(&mut voxels);
                json!({ "index": brick.index, "kind": "packed", "voxel_runs": runs(&voxels) })
            }
        })
        .collect();
    json!({
        "sequence": view.header.sequence,
        "clay_epoch": view.header.clay_epoch,
        "bricks_per_axis": view.header.bricks_per_axis,
        "keyframe": view.header.kind == BricksKind::Keyframe,
        "voxel_size_m": float(view.header.voxel_size_m.into()),
        "bricks": bricks,
    })
}

/// Voxels run by run, `[count, occupancy]`.
pub fn runs(voxels: &[u8; BRICK_VOXELS]) -> Value {
    let runs: Vec<(usize, u8)> = voxels
        .chunk_by(|a, b| a == b)
        .map(|run| (run.len(), run[0]))
        .collect();
    json!(runs)
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn header_value(header: &Header) -> Value {
    json!({
        "lease": header.lease,
        "sequence": header.sequence,
        // As text, because a JSON number does not hold 64 bits everywhere.
        "sent_ns": header.sent_ns.to_string(),
        "echo_ns": header.echo_ns.to_string(),
        "echo_hold_ns": header.echo_hold_ns,
        "scheme": header.scheme.word(),
        "revision": header.revision,
        "clay_epoch": header.clay_epoch,
        "ownership_epoch": header.ownership_epoch,
    })
}

fn floats(values: [f64; 3]) -> Value {
    Value::Array(values.map(float).to_vec())
}

fn singles(values: [f32; 3]) -> Value {
    floats(values.map(f64::from))
}

/// What is not finite, and what a reader may lose the sign of, stands as text.
fn float(value: f64) -> Value {
    if value.is_nan() {
        json!("NaN")
    } else if value.is_infinite() {
        json!(if 0.0 < value { "Infinity" } else { "-Infinity" })
    } else if value == 0.0 && value.is_sign_negative() {
        json!("-0")
    } else {
        json!(value)
    }
}
