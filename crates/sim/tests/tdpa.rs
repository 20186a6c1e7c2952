//! What time-domain passivity counts, and how its tool makes up for what it lags behind.

mod rigs;

use std::time::Duration;

use rigs::{TICK, TICK_S, both_ways, carving, line, running};
use teleclay_bilateral::{HandleSide, Lease};
use teleclay_device::DeviceSample;
use teleclay_link::scheme::tdpa::{DRIFT_SPEED_M_S, RESERVE_J};
use teleclay_link::time::Timestamp;
use teleclay_operator::{Intent, Waypoint};
use teleclay_proto::frame::{Header, LoopStatus, ToolFrame};
use teleclay_proto::{Material, Scheme};
use teleclay_sim::rig::Rig;

/// A handle that is at rest whenever it is sampled and has moved all the same: what counts is the way, against the
/// force that was felt on it.
#[test]
fn energy_is_counted_by_the_way_and_not_by_the_velocity() {
    const WAY_M: f64 = 2e-5;
    let mut handle = HandleSide::new(
        &running(Scheme::Tdpa),
        Lease {
            number: 7,
            ownership_epoch: 0,
        },
    )
    .unwrap();
    let (mut now, mut work_j) = (Timestamp::ZERO.after(TICK), 0.0);
    let mut felt_n = 0.0;
    for tick in 1..1500 {
        let frame = ToolFrame {
            header: Header {
                lease: 7,
                sequence: tick,
                scheme: Scheme::Tdpa,
                sent_ns: now.as_nanos(),
                ..Header::default()
            },
            status: LoopStatus::Running,
            force_n: [-2.0, 0.0, 0.0],
            ..ToolFrame::default()
        };
        handle.handle_frame(now, &frame);
        // The force of the tick before was felt on the way to here.
        work_j += -felt_n * WAY_M;
        let sample = DeviceSample {
            position_m: [f64::from(tick) * WAY_M, 0.0, 0.0],
            velocity_m_s: [0.0; 3],
            hand_force_n: [0.0; 3],
        };
        felt_n = handle.step(now, &sample).felt_force_n[0];
        now = now.after(TICK);
    }
    assert!((felt_n + 2.0).abs() < 1e-9, "felt {felt_n} N");
    let counted_j = handle.frame().energy_in_j[0];
    assert!(
        (counted_j + RESERVE_J - work_j).abs() < 1e-9,
        "{counted_j} J and the reserve of {work_j} J"
    );
}

/// A calm hand that goes to one side above the clay at 60 mm/s, and stays there.
fn aside() -> Rig {
    let there = Intent::trajectory(&[Waypoint {
        position_m: [0.05, 0.0, 0.02],
        speed_m_s: 0.06,
    }]);
    carving(
        running(Scheme::Tdpa),
        there.unwrap(),
        Material::default(),
        both_ways(line(2, 0.0, 0.0), 1),
    )
}

/// Between two frames the tool goes on as it was told, but only for so long: silence is noticed after 100 ms, a
/// velocity is good for 40.
#[test]
fn a_velocity_that_is_not_confirmed_is_not_followed_for_long() {
    let mut rig = aside();
    rig.run_for(Duration::from_millis(800));
    let speed_m_s = rig.tool().view().velocity_m_s[0];
    assert!(0.05 < speed_m_s, "{speed_m_s} m/s");
    let from_m = rig.tool().view().position_m[0];
    rig.impair(both_ways(line(2, 0.0, 1.0), 1));
    rig.run_for(Duration::from_millis(98));
    let way_m = rig.tool().view().position_m[0] - from_m;
    // Two frames are still on the line, and the tool lags a little.
    assert!(
        0.02 * speed_m_s < way_m && way_m < 0.055 * speed_m_s,
        "{way_m} m at {speed_m_s} m/s"
    );
}

/// An outage leaves the tool behind. It makes that up, and gently.
#[test]
fn a_tool_that_was_left_behind_comes_back_and_slowly() {
    let mut rig = aside();
    rig.run_for(Duration::from_millis(600));
    rig.impair(both_ways(line(2, 0.0, 1.0), 1));
    rig.run_for(Duration::from_millis(1200));
    let apart_m = |rig: &Rig| rig.tool().distance_from_m(rig.device().sample().position_m);
    let before_m = apart_m(&rig);
    assert!(0.01 < before_m, "only {before_m} m behind");
    rig.impair(both_ways(line(2, 0.0, 0.0), 1));
    let mut fastest_m_s = 0.0_f64;
    for _ in 0..3000 {
        rig.tick();
        let tool_m_s = rig.tool().view().velocity_m_s[0];
        let hand_m_s = rig.device().sample().velocity_m_s[0];
        fastest_m_s = fastest_m_s.max(tool_m_s - hand_m_s.max(0.0));
    }
    assert!(
        apart_m(&rig) < 0.1 * before_m,
        "{} of {before_m} m are left",
        apart_m(&rig)
    );
    // The hand's velocity is two ticks old at the tool.
    let most_m_s = DRIFT_SPEED_M_S + 2.0 * TICK_S * 5.0;
    assert!(
        fastest_m_s < most_m_s,
        "{fastest_m_s} m/s faster than the hand"
    );
}
