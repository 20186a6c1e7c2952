//! Frames of the loop.

use serde_json::{Value, json};
use teleclay_proto::Scheme;
use teleclay_proto::frame::{
    CopyState, Corrections, Engagement, Gap, Gaps, HandleFrame, Header, LoopStatus, MAX_FRAME,
    MAX_GAPS, MAX_SWEEPS, SweepRecord, SweepRefusal, Sweeps, ToolFrame,
};

use super::values::{handle_frame_value, hex, tool_frame_value};

pub(super) fn handle_frames() -> Value {
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
            from: [5, 6, 7],
            to: [5 - 0x8000, 6 + 0x7fff, 7],
        },
        SweepRecord {
            sequence: 2,
            from: [-2, -3, -4],
            to: [-5, -6, -7],
        },
    ] {
        sweeps.push(sweep).expect("four fit");
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
        relayed_acknowledged: 0x5453_5251,
        relayed_gaps: gaps(&[[1, 2], [0x7271, 0x7473]]),
        copy: CopyState::Stale,
        corrections: Corrections {
            moved_n: 1.5,
            held_n: [0.5, -0.75, 0.0625],
            largest_step_n: 0.375,
            injected_j: 0.001953125,
            tank_j: 0.03125,
            count: 0x6463_6261,
        },
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
    let many = [[3, 7]; MAX_GAPS];
    let longest = HandleFrame {
        header: Header {
            scheme: Scheme::Replica,
            ..Header::default()
        },
        engagement: Engagement::Leaving,
        position_m: [f64::NAN, f64::INFINITY, f64::NEG_INFINITY],
        velocity_m_s: [-0.0, f64::MIN_POSITIVE, f64::MAX],
        sweeps: full,
        relayed_gaps: gaps(&many),
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
            case("as many sweeps and gaps as fit, floats that are not finite", &longest),
        ],
    })
}

pub(super) fn tool_frames() -> Value {
    let mut relayed = Sweeps::new(8);
    relayed
        .push(SweepRecord {
            sequence: 9,
            from: [2, 3, 4],
            to: [-2, -3, -4],
        })
        .expect("one fits");
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
        sweeps_durable: 0x3c3b_3a39,
        epochs_kept: 0x17,
        sweep_gaps: gaps(&[[0x5251, 0x5453]]),
        sweeps_refused: 0x4847_4645,
        clay_hash: 0xfedc_ba98_7654_3210,
        relayed,
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
            case("a tool in fault", &fault),
        ],
    })
}

fn gaps(pairs: &[[u16; 2]]) -> Gaps {
    let mut gaps = Gaps::default();
    for &[missing, come] in pairs {
        gaps.push(Gap { missing, come }).expect("it is one");
    }
    gaps
}

fn header() -> Header {
    Header {
        lease: 0x0403_0201,
        sequence: 0x0807_0605,
        sent_ns: 0x1817_1615_1413_1211,
        echo_ns: 0x2827_2625_2423_2221,
        echo_hold_ns: 0x0c0b_0a09,
        scheme: Scheme::Tdpa,
        revision: 0x3c3b_3a39,
        clay_epoch: 0x3433_3231,
        ownership_epoch: 0x3837_3635,
    }
}
