//! What the vectors hold.

use serde::Serialize;
use serde_json::{Value, json};
use teleclay_proto::frame::{
    Engagement, HandleFrame, Header, LoopStatus, MAX_FRAME, MAX_SWEEPS, SweepRecord, SweepRefusal,
    Sweeps, ToolFrame,
};
use teleclay_proto::http::{
    Burst, ClayHash, ClayReset, ClayShape, ClaySpec, ClayState, FieldError, Impairment,
    JitterDistribution, LoopState, Material, Network, NewSession, Outage, Problem, Quantiles,
    Session, SessionState, TickQuantiles, ToolState, parse,
};
use teleclay_proto::join::{
    ClayDescription, FreshReply, FreshRequest, Granted, JoinReply, JoinRequest, LeaveReply,
    LeaveRequest, LoopParameters, RefusalCode,
};
use teleclay_proto::keys::{Key, Leaf, SessionKeys};
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickBody, BrickContent, BricksHeader, BricksView, BricksWriter, ClientText,
    Level, Picture, ServerText, Switch, TelemetryBatch, TelemetrySample, TelemetryView, pack,
};
use teleclay_proto::{Axes, NodeName, PROTOCOL, Scheme, SessionId, ToolDescription};

/// Every file: its name and its text.
pub fn files() -> Vec<(&'static str, String)> {
    let files = [
        ("handle_frames.json", handle_frames()),
        ("tool_frames.json", tool_frames()),
        ("telemetry.json", telemetry()),
        ("bricks.json", bricks()),
        ("packed_bricks.json", packed_bricks()),
        ("refused.json", refused()),
        ("server_texts.json", server_texts()),
        ("client_texts.json", client_texts()),
        ("join.json", join()),
        ("keys.json", keys()),
    ];
    files.map(|(name, file)| (name, pretty(&file))).to_vec()
}

/// A handle frame as the vectors tell it.
pub fn handle_frame_value(frame: &HandleFrame) -> Value {
    let sweeps: Vec<Value> = frame
        .sweeps
        .iter()
        .map(|sweep| json!({ "sequence": sweep.sequence, "from": sweep.from, "to": sweep.to }))
        .collect();
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
        "oldest_unacknowledged": frame.sweeps.oldest_unacknowledged,
        "sweeps": sweeps,
    })
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
        "sweeps_refused": frame.sweeps_refused,
        "clay_hash": ClayHash(frame.clay_hash).to_string(),
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
        "whole": view.header.picture == Picture::Whole,
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

fn header() -> Header {
    Header {
        lease: 0x0403_0201,
        sequence: 0x0807_0605,
        sent_ns: 0x1817_1615_1413_1211,
        echo_ns: 0x2827_2625_2423_2221,
        echo_hold_ns: 0x0c0b_0a09,
        scheme: Scheme::Tdpa,
        revision: 0x3635,
        clay_epoch: 0x3433_3231,
    }
}

fn handle_frames() -> Value {
    let mut sweeps = Sweeps::new(0xffff_fffe);
    for sweep in [
        SweepRecord {
            sequence: 0xffff_fffe,
            from: [0, 1, -1],
            to: [i32::MIN, i32::MAX, 0x0403_0201],
        },
        SweepRecord {
            sequence: 0xffff_ffff,
            from: [2, 3, 4],
            to: [5, 6, 7],
        },
        SweepRecord {
            sequence: 0,
            from: [-2, -3, -4],
            to: [-5, -6, -7],
        },
    ] {
        sweeps.push(sweep).expect("three fit");
    }
    let every_field = HandleFrame {
        header: header(),
        engagement: Engagement::Engaged,
        position_m: [0.5, -0.25, 0.125],
        velocity_m_s: [1.0, -2.0, 3.0],
        hand_force_n: [4.0, -5.0, 6.0],
        felt_force_n: [-7.0, 8.0, -9.0],
        wave: [0.1, 0.2, 0.3],
        wave_integral: [10.5, 11.5, 12.5],
        energy_in_j: [1e-3, 2e-3, 3e-3],
        clay_hash: 0xfedc_ba98_7654_3210,
        sweeps,
    };
    let mut full = Sweeps::new(1);
    for sequence in 1..=MAX_SWEEPS as u32 {
        let at = sequence as i32 * 1000;
        full.push(SweepRecord {
            sequence,
            from: [at, 0, -at],
            to: [at + 1000, 0, -at - 1000],
        })
        .expect("it fits");
    }
    let longest = HandleFrame {
        header: Header {
            scheme: Scheme::Replica,
            ..Header::default()
        },
        engagement: Engagement::Leaving,
        position_m: [f64::NAN, f64::INFINITY, f64::NEG_INFINITY],
        velocity_m_s: [-0.0, f64::MIN_POSITIVE, f64::MAX],
        sweeps: full,
        ..HandleFrame::default()
    };
    let case = |name: &str, frame: &HandleFrame| {
        let mut buffer = [0; MAX_FRAME];
        json!({ "name": name, "hex": hex(frame.encode(&mut buffer)), "value": handle_frame_value(frame) })
    };
    json!({
        "about": "frames from the handle to the tool side",
        "cases": [
            case("a handle at rest", &HandleFrame::default()),
            case("every field, numbers about to wrap", &every_field),
            case("as many sweeps as fit, floats that are not finite", &longest),
        ],
    })
}

fn tool_frames() -> Value {
    let every_field = ToolFrame {
        header: Header {
            scheme: Scheme::Wave,
            ..header()
        },
        status: LoopStatus::Running,
        refusal: SweepRefusal::TooFast,
        position_m: [0.5, -0.25, 0.125],
        velocity_m_s: [1.0, -2.0, 3.0],
        force_n: [4.0, -5.0, 6.0],
        wave: [0.1, 0.2, 0.3],
        wave_integral: [10.5, 11.5, 12.5],
        energy_in_j: [1e-3, 2e-3, 3e-3],
        engaged_area_m2: 1e-4,
        sweeps_acknowledged: 0x4443_4241,
        sweeps_refused: 0x4847_4645,
        clay_hash: 0xfedc_ba98_7654_3210,
    };
    let fault = ToolFrame {
        status: LoopStatus::Fault,
        refusal: SweepRefusal::Fault,
        ..ToolFrame::default()
    };
    let case = |name: &str, frame: &ToolFrame| {
        let mut buffer = [0; MAX_FRAME];
        json!({ "name": name, "hex": hex(frame.encode(&mut buffer)), "value": tool_frame_value(frame) })
    };
    json!({
        "about": "frames from the tool side to the handle",
        "cases": [
            case("a tool at rest", &ToolFrame::default()),
            case("every field", &every_field),
            case("a session in fault", &fault),
        ],
    })
}

fn telemetry() -> Value {
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

fn bricks() -> Value {
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
    let whole = BricksHeader {
        sequence: 0,
        clay_epoch: 3,
        bricks_per_axis: [16, 8, 8],
        picture: Picture::Whole,
        voxel_size_m: 0.000_5,
    };
    let changes = BricksHeader {
        sequence: 0x0807_0605,
        picture: Picture::Changes,
        ..whole
    };
    let (flat, ball) = (flat_top(), ball());
    json!({
        "about": "bricks of clay",
        "cases": [
            case("a whole picture without bricks", &whole, &[]),
            case("a whole picture", &whole, &[
                (0, BrickContent::Full),
                (1, BrickContent::Empty),
                (17, BrickContent::Voxels(&flat)),
                (1023, BrickContent::Voxels(&ball)),
            ]),
            case("one change", &changes, &[(512, BrickContent::Voxels(&flat))]),
        ],
    })
}

fn packed_bricks() -> Value {
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

fn refused() -> Value {
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
            case("handle_frame", "no such scheme", "unknown_value", with(&handle, 38, 5)),
            case("handle_frame", "no such engagement", "unknown_value", with(&handle, 39, 3)),
            case("handle_frame", "reserved bytes in use", "reserved_not_zero", with(&handle, 222, 1)),
            case("handle_frame", "a sweep is announced but missing", "too_short", with(&handle, 220, 1)),
            case("handle_frame", "25 sweeps", "too_many", [&with(&handle, 220, 25)[..], &[0; 25 * 28]].concat()),
            case("tool_frame", "a byte too few", "too_short", shorter(&tool)),
            case("tool_frame", "a byte too many", "trailing_bytes", longer(&tool)),
            case("tool_frame", "a handle frame", "wrong_kind", handle.clone()),
            case("tool_frame", "no such status", "unknown_value", with(&tool, 39, 4)),
            case("tool_frame", "no such refusal", "unknown_value", with(&tool, 208, 7)),
            case("tool_frame", "reserved bytes in use", "reserved_not_zero", with(&tool, 215, 1)),
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

fn server_texts() -> Value {
    let session = session();
    let id = session.id.clone();
    let hello = ServerText::Hello {
        protocol: PROTOCOL,
        session: id,
        server_version: "0.1.0".to_owned(),
    };
    let event = ServerText::Event {
        level: Level::Warning,
        text: "no frame for 0.1 s".to_owned(),
        time_s: 12.5,
    };
    let problem = ServerText::Problem {
        problem: FieldError::new(
            "/session/network/up/delay_s",
            "3 is not a number from 0 to 2",
        )
        .into(),
    };
    let busy = ServerText::Problem {
        problem: Problem::new("busy", "the server is busy", 503, "eight sessions run"),
    };
    texts(
        "text messages from the server",
        &[
            ("hello", hello),
            (
                "state",
                ServerText::State {
                    session: Box::new(session),
                },
            ),
            ("event", event),
            ("a problem with a field", problem),
            ("a problem without a field", busy),
            ("pong", ServerText::Pong { nonce: u32::MAX }),
        ],
    )
}

fn client_texts() -> Value {
    let full = Network {
        up: impairment(),
        down: Impairment::default(),
    };
    let patch = |text: &str| Box::new(parse(text.as_bytes()).expect("the patch is good"));
    let reset = ClayReset {
        shape: Some(ClayShape::stepped()),
        material: Some(Material::default()),
    };
    let mut file = texts(
        "text messages to the server",
        &[
            (
                "subscribe",
                ClientText::Subscribe {
                    telemetry: Switch::On,
                    bricks: Switch::Off,
                },
            ),
            (
                "a patch of nothing",
                ClientText::Patch {
                    session: patch("{}"),
                },
            ),
            (
                "a patch of one number",
                ClientText::Patch {
                    session: patch(r#"{"network":{"up":{"delay_s":0.05}}}"#),
                },
            ),
            (
                "a patch that ends bursts",
                ClientText::Patch {
                    session: patch(r#"{"network":{"down":{"burst":null}}}"#),
                },
            ),
            (
                "a patch of everything",
                ClientText::Patch {
                    session: Box::new(teleclay_proto::http::SessionPatch {
                        scheme: Some(Scheme::PositionForce),
                        material: Some(
                            Material {
                                viscosity_pa_s_per_m: 4e5,
                                yield_stress_pa: 500.0,
                                stiffness_pa: 2e6,
                            }
                            .into(),
                        ),
                        network: Some(full.into()),
                        paused: Some(true),
                    }),
                },
            ),
            (
                "a fresh block as the last",
                ClientText::Reset {
                    clay: ClayReset::default(),
                },
            ),
            ("a fresh block", ClientText::Reset { clay: reset }),
            ("ping", ClientText::Ping { nonce: 0 }),
        ],
    );
    file["refused"] = Value::Array(
        REFUSED_TEXTS
            .iter()
            .map(|(pointer, text)| json!({ "pointer": pointer, "text": text }))
            .collect(),
    );
    file
}

/// Texts that the server refuses, and the field it names; `None` where the text is not JSON at all.
const REFUSED_TEXTS: &[(Option<&str>, &str)] = &[
    (None, ""),
    (None, "{"),
    (None, r#"{"type":"ping","nonce":1} {}"#),
    (None, r#"{"type":"ping","nonce":NaN}"#),
    (Some(""), "[]"),
    (Some(""), r#"{"nonce":1}"#),
    (Some("/type"), r#"{"type":"pong","nonce":1}"#),
    (Some(""), r#"{"type":"ping"}"#),
    (Some("/nonce"), r#"{"type":"ping","nonce":-1}"#),
    (Some("/extra"), r#"{"type":"ping","nonce":1,"extra":1}"#),
    (Some(""), r#"{"type":"ping","nonce":1,"bricks":"on"}"#),
    (
        Some("/bricks"),
        r#"{"type":"subscribe","telemetry":"on","bricks":true}"#,
    ),
    (
        Some("/session/paused"),
        r#"{"type":"patch","session":{"paused":null}}"#,
    ),
    (
        Some("/session/scheme"),
        r#"{"type":"patch","session":{"scheme":"waves"}}"#,
    ),
    (
        Some("/session/network"),
        r#"{"type":"patch","session":{"network":[]}}"#,
    ),
    (
        Some("/session/network/up/delay_s"),
        r#"{"type":"patch","session":{"network":{"up":{"delay_s":2.1}}}}"#,
    ),
    (
        Some("/session/network/down/burst/leave"),
        r#"{"type":"patch","session":{"network":{"down":{"burst":{"enter":0,"leave":2,"loss_in_burst":1}}}}}"#,
    ),
    (
        Some("/session/material/stiffness_pa"),
        r#"{"type":"patch","session":{"material":{"stiffness_pa":-1}}}"#,
    ),
    (
        Some("/clay/shape/size_m/2"),
        r#"{"type":"reset","clay":{"shape":{"kind":"block","size_m":[0.1,0.1,0]}}}"#,
    ),
    (
        Some("/clay/shape/edges_m/2"),
        r#"{"type":"reset","clay":{"shape":{"kind":"stepped","edges_m":[0,0.1,0.1,0.2]}}}"#,
    ),
];

fn join() -> Value {
    let request = JoinRequest {
        protocol: PROTOCOL,
        operator: "Ada".to_owned(),
        token: Some("let me in".to_owned()),
        device: "simulated".to_owned(),
    };
    let granted = Granted {
        lease: 17,
        tool: 1,
        lease_s: 5.0,
        parameters: LoopParameters::default(),
        clay: ClayDescription {
            shape: ClayShape::default(),
            voxel_size_m: 5e-4,
            epoch: 1,
            revision: 0,
        },
        slow_endpoint: Some("tcp/127.0.0.1:7448".to_owned()),
    };
    let refused = JoinReply::Refused {
        code: RefusalCode::NoFreeTool,
        reason: "the only tool of session `demo` is held by Ada".to_owned(),
    };
    json!({
        "about": "joining, leaving, and asking for a fresh block",
        "requests": [text("a join", &request), text("a join without a token", &JoinRequest { token: None, ..request })],
        "replies": [text("granted", &JoinReply::Granted(Box::new(granted))), text("refused", &refused)],
        "leave_requests": [text("a leave", &LeaveRequest { lease: 17 })],
        "leave_replies": [text("left", &LeaveReply::Left), text("no such lease", &LeaveReply::NoSuchLease)],
        "fresh_requests": [text("a fresh block", &FreshRequest { lease: 17 })],
        "fresh_replies": [
            text("fresh", &FreshReply::Fresh { epoch: 2 }),
            text("refused", &FreshReply::Refused { reason: "nobody holds lease 17".to_owned() }),
        ],
        "parameters": [text("parameters", &LoopParameters { revision: 2, axes: Axes::Three, ..LoopParameters::default() })],
        "new_sessions": [
            text("every default", &NewSession::new(id("demo"))),
            text("nothing left at its default", &NewSession {
                id: id("carving-2"),
                axes: Axes::Three,
                scheme: Scheme::Tdpa,
                material: Material { viscosity_pa_s_per_m: 1e5, yield_stress_pa: 2e3, stiffness_pa: 3e5 },
                network: Network { up: impairment(), down: impairment() },
                clay: ClaySpec { shape: ClayShape::stepped(), voxel_size_m: 1e-3 },
                tool: ToolDescription::Ball { radius_m: 0.0064 },
                tools: 8,
            }),
        ],
    })
}

fn keys() -> Value {
    let node = NodeName::new("lab-1").expect("the name is good");
    let keys = SessionKeys::new(node.clone(), id("demo"));
    let leaves = [
        Leaf::Join,
        Leaf::Leave,
        Leaf::Parameters,
        Leaf::ToolUp(1),
        Leaf::ToolDown(u32::MAX),
        Leaf::ClayBricks,
        Leaf::ClaySnapshot,
        Leaf::ClayFresh,
        Leaf::State,
        Leaf::Operator(17),
    ];
    let mut good = vec![Key::Alive(node).to_string()];
    good.extend(leaves.map(|leaf| Key::Session(keys.clone(), leaf).to_string()));
    json!({
        "about": "key expressions of node `lab-1` and its session `demo`",
        "good": good,
        "bad": [
            "",
            "teleclay",
            "teleclay/",
            "teleclay//alive",
            "teleclay/lab-1",
            "teleclay/lab-1/",
            "teleclay/lab-1/alive/",
            "teleclay/Lab/alive",
            "teleclay/lab-1/session/demo",
            "teleclay/lab-1/session//join",
            "teleclay/lab-1/session/a b/join",
            "teleclay/lab-1/session/demo/tool/up",
            "teleclay/lab-1/session/demo/tool/01/up",
            "teleclay/lab-1/session/demo/tool/+1/up",
            "teleclay/lab-1/session/demo/tool/-1/up",
            "teleclay/lab-1/session/demo/tool/4294967296/up",
            "teleclay/lab-1/session/demo/tool/*/up",
            "teleclay/lab-1/session/demo/operator/",
            "teleclay/*/alive",
            "other/lab-1/alive",
            "/teleclay/lab-1/alive",
        ],
    })
}

fn texts<T: Serialize>(about: &str, cases: &[(&str, T)]) -> Value {
    let cases: Vec<Value> = cases
        .iter()
        .map(|(name, value)| text(name, value))
        .collect();
    json!({ "about": about, "cases": cases })
}

fn text(name: &str, value: &impl Serialize) -> Value {
    json!({ "name": name, "value": value })
}

fn id(name: &str) -> SessionId {
    SessionId::new(name).expect("the name is good")
}

fn impairment() -> Impairment {
    Impairment {
        delay_s: 0.04,
        jitter_s: 0.008,
        loss: 0.01,
        seed: (1 << 53) - 1,
        jitter_distribution: JitterDistribution::HeavyTailed,
        duplicate: 0.02,
        reorder: 0.03,
        burst: Some(Burst {
            enter: 0.01,
            leave: 0.25,
            loss_in_burst: 0.9,
        }),
        outage: Some(Outage {
            every_s: 5.0,
            length_s: 0.2,
        }),
    }
}

fn session() -> Session {
    Session {
        id: id("demo"),
        scheme: Scheme::Replica,
        axes: Axes::Two,
        state: SessionState::Running,
        fault: None,
        material: Material::default(),
        network: Network {
            up: impairment(),
            down: Impairment::default(),
        },
        clay: ClayState {
            voxel_size_m: 5e-4,
            initial_volume_m3: 5.24288e-4,
            remaining_volume_m3: 5.24288e-4,
            removed_volume_m3: 0.0,
            initial_units: 1_069_547_520,
            remaining_units: 1_069_547_520,
            removed_units: 0,
            unit_volume_m3: 4.90196078431373e-13,
            hash: ClayHash(0x0123_4567_89ab_cdef),
            shape: ClayShape::default(),
            epoch: 1,
        },
        tool: ToolDescription::default(),
        tools: vec![ToolState {
            id: 1,
            operator: "Ada".to_owned(),
            connected: true,
            position_m: [0.031, 0.032, 0.01],
            force_n: [-0.5, 0.0, 0.0],
            handle_position_m: [0.031, 0.0, 0.0],
            felt_force_n: [-0.5, 0.0, 0.0],
            hand_force_n: [2.0, 0.0, 0.0],
            home_m: [0.0, 0.032, 0.01],
        }],
        position_ratio: 1.0,
        coordination_m: 2.5e-5,
        control_loop: LoopState {
            rate_hz: 1000.0,
            ticks: 123_456,
            late_ticks: 3,
            tick_s: TickQuantiles {
                p50: 6e-6,
                p99: 1.2e-5,
                p999: 4e-5,
                max: 1.1e-4,
            },
            rtt_s: Quantiles {
                p50: 8e-4,
                p99: 1.6e-3,
            },
            age_s: Quantiles {
                p50: 5e-4,
                p99: 1.1e-3,
            },
            lost: 4,
            duplicates: 5,
            reordered: 6,
            packets_up_per_s: 999.5,
            packets_down_per_s: 1000.0,
            energy_j: 0.0125,
            scheduler: "SCHED_OTHER, SCHED_FIFO was not permitted".to_owned(),
        },
    }
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

/// SplitMix64.
fn next_random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut mixed = *state;
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

/// One line per case, so that a change shows as the lines that changed.
fn pretty(file: &Value) -> String {
    let Value::Object(parts) = file else {
        unreachable!("every file is an object")
    };
    let parts: Vec<String> = parts
        .iter()
        .map(|(name, part)| match part {
            Value::Array(cases) => {
                let cases: Vec<String> = cases.iter().map(|case| format!("    {case}")).collect();
                format!("  {name:?}: [\n{}\n  ]", cases.join(",\n"))
            }
            other => format!("  {name:?}: {other}"),
        })
        .collect();
    format!("{{\n{}\n}}\n", parts.join(",\n"))
}
