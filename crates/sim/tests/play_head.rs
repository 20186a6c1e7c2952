//! A tick without a frame, and the one with two that follows it, under position-force: neither is felt.

mod rigs;

use rigs::{TICK, TICK_S, both_ways, embedded, norm, running, viscous};
use teleclay_device::DeviceSample;
use teleclay_link::conditioner::Impairment;
use teleclay_operator::Intent;
use teleclay_proto::Scheme;

/// A line whose delay is about a tick, so that about every other frame comes a tick after the one that it was sent for.
fn between_ticks() -> Impairment {
    Impairment {
        delay: TICK,
        jitter: TICK.mul_f64(0.1),
        ..Impairment::default()
    }
}

#[test]
fn in_steady_cutting_the_force_changes_by_no_more_than_a_frames_change() {
    let mut rig = embedded(
        running(Scheme::PositionForce),
        Intent::Idle,
        viscous(1e5),
        both_ways(between_ticks(), 1),
    );
    let speed_m_s = 0.02;
    let (mut least_n, mut most_n) = (f64::MAX, 0.0_f64);
    let mut before = rig.tool().arrivals().received;
    let (mut empty, mut double) = (0, 0);
    for ms in 0..3000 {
        rig.hold_handle_at(DeviceSample {
            position_m: [speed_m_s * TICK_S * f64::from(ms) - 0.02, 0.0, 0.0],
            velocity_m_s: [speed_m_s, 0.0, 0.0],
            hand_force_n: [0.0; 3],
        });
        rig.tick();
        let received = rig.tool().arrivals().received;
        if 1200 < ms {
            empty += u32::from(received == before);
            double += u32::from(before + 2 == received);
            let felt_n = norm(rig.last().felt_force_n);
            least_n = least_n.min(felt_n);
            most_n = most_n.max(felt_n);
        }
        before = received;
    }
    println!(
        "{empty} ticks without a frame, {double} with two; felt {least_n:.3} to {most_n:.3} N"
    );
    assert!(
        100 < empty && 100 < double,
        "{empty}, {double}: nothing is tried here"
    );
    assert!(
        0.0 < least_n && most_n < 1.3 * least_n,
        "{least_n} to {most_n} N"
    );
}
