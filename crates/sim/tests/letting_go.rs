//! Whatever a tool side asked for last, silence lets go of the hand within `silence_s` and `ramp_s`, by the slew.

use std::time::Duration;

use teleclay_bilateral::{HandleSide, Lease};
use teleclay_device::DeviceSample;
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Header, LoopStatus, ToolFrame};
use teleclay_proto::join::LoopParameters;

const TICK: Duration = Duration::from_millis(1);
/// The last tick with a frame.
const LAST_FRAME: u32 = 600;

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// What a hand that holds its handle fast feels, tick by tick, of a tool side that presses with `force_n` and then
/// falls silent.
fn felt(parameters: &LoopParameters, force_n: f64) -> Vec<[f64; 3]> {
    let lease = Lease {
        number: 7,
        ownership_epoch: 0,
    };
    let mut handle = HandleSide::new(parameters, lease).unwrap();
    let mut now = Timestamp::ZERO;
    let mut felt = Vec::new();
    for tick in 1..=LAST_FRAME + 400 {
        now = now.after(TICK);
        if tick <= LAST_FRAME {
            let frame = ToolFrame {
                header: Header {
                    lease: 7,
                    sequence: tick,
                    scheme: parameters.scheme,
                    sent_ns: now.as_nanos(),
                    ..Header::default()
                },
                status: LoopStatus::Running,
                force_n: [-force_n, force_n, 0.0],
                wave: [-force_n, force_n, 0.0],
                ..ToolFrame::default()
            };
            handle.handle_frame(now, &frame);
        }
        felt.push(handle.step(now, &DeviceSample::default()).felt_force_n);
    }
    felt
}

#[test]
fn a_wish_beyond_the_limit_is_let_go_of_as_soon_as_any() {
    for scheme in [
        Scheme::ForceExchange,
        Scheme::PositionForce,
        Scheme::Wave,
        Scheme::Tdpa,
    ] {
        for (force_n, slew_limit_n_per_s) in
            [(2.0, 2000.0), (20.0, 2000.0), (1e5, 2000.0), (1e5, 150.0)]
        {
            let parameters = LoopParameters {
                scheme,
                slew_limit_n_per_s,
                ..LoopParameters::default()
            };
            let felt = felt(&parameters, force_n);
            let case = format!("{scheme}, {force_n} N, {slew_limit_n_per_s} N/s");
            let pressed_n = norm(felt[LAST_FRAME as usize - 1]);
            if matches!(scheme, Scheme::ForceExchange | Scheme::PositionForce) {
                let most_n = parameters
                    .force_limit_n
                    .min(slew_limit_n_per_s * parameters.ramp_s);
                let wanted_n = most_n.min(force_n * 2_f64.sqrt());
                assert!(
                    (pressed_n - wanted_n).abs() < 1e-6,
                    "{case}: pressed with {pressed_n} N"
                );
            }
            assert!(
                felt.iter()
                    .all(|&force| norm(force) <= parameters.force_limit_n + 1e-9),
                "{case}"
            );
            for pair in felt.windows(2) {
                let step_n = norm(std::array::from_fn(|axis| pair[1][axis] - pair[0][axis]));
                assert!(
                    step_n <= slew_limit_n_per_s * 1e-3 + 1e-9,
                    "{case}: {step_n} N in a tick"
                );
            }
            let gone = felt
                .iter()
                .rposition(|&force| 0.0 < norm(force))
                .unwrap_or(0);
            // The silence is over one tick after it is longer than allowed, and the ramp takes fifty.
            let after_ms = gone as i64 + 2 - i64::from(LAST_FRAME);
            println!("{case}: {pressed_n:.2} N, gone {after_ms} ms after the last frame");
            assert!(after_ms <= 152, "{case}: gone after {after_ms} ms");
        }
    }
}
