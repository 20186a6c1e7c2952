//! How far apart hand and tool are, at one instant.

mod rigs;

use std::time::Duration;

use rigs::{TICK_S, both_ways, embedded, line, running, viscous};
use teleclay_device::DeviceSample;
use teleclay_operator::Intent;
use teleclay_proto::Scheme;

/// Where somebody has the handle who goes on at a steady speed along x, m/s, from the start.
fn going(speed_m_s: f64, ms: u32) -> DeviceSample {
    DeviceSample {
        position_m: [speed_m_s * TICK_S * f64::from(ms), 0.0, 0.0],
        velocity_m_s: [speed_m_s, 0.0, 0.0],
        hand_force_n: [0.0; 3],
    }
}

/// Under position-force the tool is where the hand was a delay ago: what the hand went meanwhile lies between them. It
/// is so whatever the handle's clock shows.
#[test]
fn with_a_delay_the_tool_is_behind_by_the_way_of_the_hand_meanwhile() {
    for (delay_ms, ahead_s, ppm) in [
        (150, 0, 0.0),
        (150, 5000, 100.0),
        (20, 77, 0.0),
        (0, 0, 0.0),
    ] {
        let lines = both_ways(line(delay_ms, 0.0, 0.0), 1);
        let mut rig = embedded(
            running(Scheme::PositionForce),
            Intent::Idle,
            viscous(1e4),
            lines,
        );
        rig.set_handle_clock(Duration::from_secs(ahead_s), ppm);
        let speed_m_s = 0.04;
        for ms in 0..1500 {
            rig.hold_handle_at(going(speed_m_s, ms));
            rig.tick();
        }
        let apart_m = rig.tool().coordination_m();
        let way_m = speed_m_s * TICK_S * f64::from(delay_ms);
        println!(
            "{delay_ms} ms: {:.2} mm apart, {:.2} mm of way",
            1e3 * apart_m,
            1e3 * way_m
        );
        // The tick in which the tool follows, and another for the clocks' rates.
        let off_m = (apart_m - way_m).abs();
        assert!(
            off_m < 3.0 * speed_m_s * TICK_S,
            "{delay_ms} ms, {ppm} ppm: {apart_m} m"
        );
        // Against the hand as it was last heard of there is nothing to be seen of the delay.
        let told_m = rig.tool().view().handle_position_m;
        assert!(rig.tool().distance_from_m(told_m) < 1e-4);
        // And none of it is left when the hand has rested for a while.
        for _ in 0..600 {
            rig.hold_handle_at(DeviceSample {
                velocity_m_s: [0.0; 3],
                ..going(speed_m_s, 1500)
            });
            rig.tick();
        }
        assert!(rig.tool().coordination_m() < 1e-6);
    }
}
