//! Telemetry, bricks, and bytes that no decoder may accept.

use serde_json::{Value, json};
use teleclay_proto::frame::{HandleFrame, MAX_FRAME, ToolFrame};
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickContent, BricksHeader, BricksKind, BricksView, BricksWriter, TelemetryBatch,
    TelemetrySample, TelemetryView, pack,
};

use super::values::{bricks_value, hex, runs, telemetry_value};

pub(super) fn telemetry() -> Value {
    let empty = TelemetryBatch {
        sequence: 7,
        tool: 1,
        period_us: 1000,
        dropped: 12,
        first_time_s: 3.25,
    };
    let two = TelemetryBatch {
        sequence: 0x0807_0605,
        tool: 2,
        period_us: 4000,
        dropped: 0,
        first_time_s: 12345.678,
    };
    let sample = TelemetrySample {
        hand_force_n: [1.0, 2.0, 3.0],
        felt_force_n: [-1.0, -2.0, -3.0],
        tool_force_n: [-1.5, -2.5, -3.5],
        handle_position_m: [0.125, 0.25, 0.5],
        tool_position_m: [0.0625, 0.03125, 0.015625],
        handle_velocity_m_s: [10.0, 20.0, 30.0],
        tool_velocity_m_s: [40.0, 50.0, 60.0],
        energy_handle_j: 0.75,
        energy_tool_j: -0.75,
        rtt_s: 0.0078125,
        correction_step_n: 0.25,
        correction_held_n: 0.5,
        age_s: 0.015625,
    };
    let unusual = TelemetrySample {
        rtt_s: f32::NAN,
        energy_tool_j: -0.0,
        ..TelemetrySample::default()
    };
    let case = |name: &str, batch: &TelemetryBatch, samples: &[TelemetrySample]| {
        let mut message = Vec::new();
        batch.encode(samples, &mut message).expect("few samples");
        let value =
            telemetry_value(&TelemetryView::decode(&message).expect("what was encoded decodes"));
        json!({ "name": name, "hex": hex(&message), "value": value })
    };
    json!({
        "about": "batches of telemetry",
        "cases": [
            case("no samples", &empty, &[]),
            case("two samples", &two, &[sample, unusual]),
        ],
    })
}

pub(super) fn bricks() -> Value {
    let case = |name: &str, header: &BricksHeader, bricks: &[(u32, BrickContent<'_>)]| {
        let mut writer = BricksWriter::new(*header, usize::MAX);
        for (index, content) in bricks {
            writer
                .push(*index, *content)
                .expect("the brick lies in the grid");
        }
        let messages = writer.finish();
        let message = messages.first().expect("a message was written");
        let value = bricks_value(&BricksView::decode(message).expect("what was encoded decodes"));
        json!({ "name": name, "hex": hex(message), "value": value })
    };
    let keyframe = BricksHeader {
        sequence: 0,
        clay_epoch: 3,
        bricks_per_axis: [16, 8, 8],
        kind: BricksKind::Keyframe,
        voxel_size_m: 0.000_5,
    };
    let delta = BricksHeader {
        sequence: 0x0807_0605,
        kind: BricksKind::Delta,
        ..keyframe
    };
    let (flat, ball) = (flat_top(), ball());
    json!({
        "about": "bricks of clay",
        "cases": [
            case("a keyframe without bricks", &keyframe, &[]),
            case("a keyframe", &keyframe, &[
                (0, BrickContent::Full),
                (1, BrickContent::Empty),
                (17, BrickContent::Voxels(&flat)),
                (1023, BrickContent::Voxels(&ball)),
            ]),
            case("a delta of one brick", &delta, &[(512, BrickContent::Voxels(&flat))]),
        ],
    })
}

pub(super) fn packed_bricks() -> Value {
    let mut random = 1_u64;
    let noise: [u8; BRICK_VOXELS] = std::array::from_fn(|_| next_random(&mut random) as u8);
    let slope: [u8; BRICK_VOXELS] =
        std::array::from_fn(|voxel| ((voxel % 16) * 16 + voxel / 256) as u8);
    // Lone zeros among residuals, pairs, and runs around the longest of a token.
    let mut residuals = [1; BRICK_VOXELS];
    for zeros in [
        0..1,
        10..11,
        20..22,
        30..33,
        200..327,
        400..528,
        600..729,
        900..1156,
        1300..1557,
        4095..4096,
    ] {
        residuals[zeros].fill(0);
    }
    let runs_of_zeros = summed(&residuals);
    let mut residuals = [0; BRICK_VOXELS];
    residuals[BRICK_VOXELS - 1] = 9;
    let last_voxel = summed(&residuals);
    let case = |name: &str, voxels: &[u8; BRICK_VOXELS]| {
        let mut packed = Vec::new();
        pack(voxels, &mut packed);
        json!({ "name": name, "hex": hex(&packed), "voxel_runs": runs(voxels) })
    };
    json!({
        "about": "voxels of one brick, packed by the writer's rule; voxel_runs are [count, occupancy]",
        "cases": [
            case("all empty", &[0; BRICK_VOXELS]),
            case("all full", &[255; BRICK_VOXELS]),
            case("a flat top", &flat_top()),
            case("a ball", &ball()),
            case("a slope", &slope),
            case("lone zeros and runs of every length that matters", &runs_of_zeros),
            case("nothing but the last voxel", &last_voxel),
            case("noise", &noise),
        ],
        "other_tokens": [
            { "name": "zeros one by one", "hex": "80".repeat(BRICK_VOXELS), "voxel_runs": [[BRICK_VOXELS, 0]] },
            { "name": "residuals one by one", "hex": "0000".repeat(BRICK_VOXELS), "voxel_runs": [[BRICK_VOXELS, 0]] },
        ],
    })
}

pub(super) fn refused() -> Value {
    let mut buffer = [0; MAX_FRAME];
    let handle = HandleFrame::default().encode(&mut buffer).to_vec();
    let tool = ToolFrame::default().encode(&mut buffer).to_vec();
    let mut telemetry = Vec::new();
    TelemetryBatch::default()
        .encode(&[TelemetrySample::default()], &mut telemetry)
        .expect("one sample fits");
    let header = BricksHeader {
        bricks_per_axis: [2, 2, 2],
        ..BricksHeader::default()
    };
    let mut writer = BricksWriter::new(header, usize::MAX);
    writer
        .push(7, BrickContent::Voxels(&flat_top()))
        .expect("7 is below 8");
    let bricks = writer.finish().remove(0);
    let with = |message: &[u8], at: usize, byte: u8| {
        let mut message = message.to_vec();
        message[at] = byte;
        message
    };
    let longer = |message: &[u8]| [message, &[0]].concat();
    let shorter = |message: &[u8]| message[..message.len() - 1].to_vec();
    // One run of so many sweeps, in so many bytes a coordinate and all told.
    let with_run = |count: u8, width: u8, length: usize| {
        let mut run = vec![0; 20 + length];
        (run[4], run[5]) = (count, width);
        [&with(&handle, 272, 1)[..], &run].concat()
    };
    let with_run_byte = |at: usize| with(&with_run(1, 2, 6), handle.len() + at, 1);
    let case = |decoder: &str, name: &str, error: &str, bytes: Vec<u8>| json!({ "decoder": decoder, "name": name, "error": error, "hex": hex(&bytes) });
    json!({
        "about": "bytes that no decoder may accept",
        "cases": [
            case("handle_frame", "nothing", "too_short", Vec::new()),
            case("handle_frame", "a byte too few", "too_short", shorter(&handle)),
            case("handle_frame", "a byte too many", "trailing_bytes", longer(&handle)),
            case("handle_frame", "another magic", "wrong_magic", with(&handle, 0, b'X')),
            case("handle_frame", "another version", "wrong_version", with(&handle, 2, 2)),
            case("handle_frame", "a tool frame", "wrong_kind", tool.clone()),
            case("handle_frame", "no such scheme", "unknown_value", with(&handle, 44, 5)),
            case("handle_frame", "no such engagement", "unknown_value", with(&handle, 45, 3)),
            case("handle_frame", "reserved bytes of the header in use", "reserved_not_zero", with(&handle, 46, 1)),
            case("handle_frame", "reserved bytes in use", "reserved_not_zero", with(&handle, 230, 1)),
            case("handle_frame", "a run of sweeps is announced but missing", "too_short", with(&handle, 272, 1)),
            case("handle_frame", "a run without a sweep", "unknown_value", with_run(0, 2, 0)),
            case("handle_frame", "a step of three bytes a coordinate", "unknown_value", with_run(1, 3, 9)),
            case("handle_frame", "reserved bytes of a run in use", "reserved_not_zero", with_run_byte(6)),
            case("handle_frame", "131 sweeps in a run", "too_many", with_run(131, 2, 131 * 6)),
            case("handle_frame", "a gap is announced but missing", "too_short", with(&handle, 229, 1)),
            case("handle_frame", "a gap of nothing", "unknown_value", [&with(&handle, 229, 1)[..], &[0, 0, 1, 0]].concat()),
            case("handle_frame", "nothing behind a gap", "unknown_value", [&with(&handle, 229, 1)[..], &[1, 0, 0, 0]].concat()),
            case("handle_frame", "17 gaps", "too_many", [&with(&handle, 229, 17)[..], &[1, 0, 1, 0].repeat(17)].concat()),
            case("tool_frame", "a byte too few", "too_short", shorter(&tool)),
            case("tool_frame", "a byte too many", "trailing_bytes", longer(&tool)),
            case("tool_frame", "a handle frame", "wrong_kind", handle.clone()),
            case("tool_frame", "no such status", "unknown_value", with(&tool, 45, 4)),
            case("tool_frame", "no such refusal", "unknown_value", with(&tool, 216, 7)),
            case("tool_frame", "reserved bytes in use", "reserved_not_zero", with(&tool, 223, 1)),
            case("watch", "nothing", "too_short", Vec::new()),
            case("watch", "a frame of the loop", "wrong_magic", handle.clone()),
            case("watch", "another version", "wrong_version", with(&telemetry, 2, 0)),
            case("watch", "no such kind", "unknown_value", with(&telemetry, 3, 3)),
            case("watch", "telemetry, a byte too few", "too_short", shorter(&telemetry)),
            case("watch", "telemetry, a byte too many", "trailing_bytes", longer(&telemetry)),
            case("watch", "telemetry, two samples announced, one there", "too_short", with(&telemetry, 12, 2)),
            case("watch", "telemetry, 16 million samples announced", "too_many", with(&telemetry, 15, 1)),
            case("watch", "bricks, a byte too few", "too_short", shorter(&bricks)),
            case("watch", "bricks, a byte too many", "trailing_bytes", longer(&bricks)),
            case("watch", "bricks, two announced, one there", "too_short", with(&bricks, 24, 2)),
            case("watch", "bricks, none announced, one there", "trailing_bytes", with(&bricks, 24, 0)),
            case("watch", "bricks, an unknown flag", "reserved_not_zero", with(&bricks, 18, 2)),
            case("watch", "bricks, outside of the grid", "brick_outside_grid", with(&bricks, 28, 8)),
            case("watch", "bricks, a grid without bricks", "brick_outside_grid", with(&bricks, 12, 0)),
            case("watch", "bricks, no such kind of brick", "unknown_value", with(&bricks, 32, 3)),
            case("watch", "bricks, reserved byte in use", "reserved_not_zero", with(&bricks, 33, 1)),
            case("watch", "bricks, an empty brick with bytes", "wrong_brick_length", with(&bricks, 32, 0)),
            case("packed", "nothing", "wrong_voxel_count", Vec::new()),
            case("packed", "a voxel too few", "wrong_voxel_count", [vec![0xff; 31], vec![0xfe]].concat()),
            case("packed", "a voxel too many", "wrong_voxel_count", [vec![0xff; 32], vec![0x80]].concat()),
            case("packed", "residuals announced but missing", "too_short", [vec![0xff; 31], vec![0x7f; 128]].concat()),
        ],
    })
}

/// Clay up to half of the voxel at height 7.
fn flat_top() -> [u8; BRICK_VOXELS] {
    std::array::from_fn(|voxel| match voxel / 256 {
        0..7 => 255,
        7 => 128,
        _ => 0,
    })
}

/// What a ball of radius 6 voxels about the middle leaves; whole numbers only, so that every machine makes the same.
fn ball() -> [u8; BRICK_VOXELS] {
    std::array::from_fn(|voxel| {
        let from_middle = |at: usize| (2 * at as i32 - 15).pow(2);
        let square =
            from_middle(voxel % 16) + from_middle(voxel / 16 % 16) + from_middle(voxel / 256);
        (square - 144).clamp(0, 255) as u8
    })
}

/// The voxels that have these residuals.
fn summed(residuals: &[u8; BRICK_VOXELS]) -> [u8; BRICK_VOXELS] {
    let mut voxels = *residuals;
    for voxel in 16..BRICK_VOXELS {
        voxels[voxel] = voxels[voxel].wrapping_add(voxels[voxel - 16]);
    }
    voxels
}

/// The generator SplitMix64, so that the same seed gives the same bytes everywhere.
fn next_random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut mixed = *state;
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}
