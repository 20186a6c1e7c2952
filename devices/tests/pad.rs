//! Gamepad and joystick on a stand-in for their port, on virtual time.

mod stand_in;

use proptest::prelude::*;
use teleclay_devices::Hardware;
use teleclay_devices::pad::driver::{FOLLOWS_M_S, PadDriver};
use teleclay_devices::pad::effect::{RENEW_NS, is_nothing};
use teleclay_devices::pad::layout::{
    EAST, RY, RZ, SHOULDER, SOUTH, START, THROTTLE, THUMB2, TRIGGER, X, Y,
};
use teleclay_devices::pad::port::{Effect, PadEvent, PortError};
use teleclay_devices::thread::Driver;
use teleclay_impedance::GraspState;

use stand_in::{Bench, MS, NEEDS, StandIn};

#[test]
fn nothing_moves_until_the_button_takes_hold_and_then_without_a_jump() {
    let mut bench = Bench::new(Hardware::Gamepad);
    bench.axis(X, 1000);
    bench.run(500).unwrap();
    assert!(bench.place_m[0].abs() <= 0.0 && bench.force_n() <= 0.0);
    bench.press(SOUTH);
    bench.run(500).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Held);
    // The stick has not moved since: whoever takes hold of a handle moves nothing by that alone.
    assert!(bench.place_m[0].abs() < 1e-12, "{:?}", bench.place_m);
    bench.axis(X, 0);
    bench.run(1500).unwrap();
    let came_m = bench.place_m[0] + 0.04;
    assert!(
        came_m.abs() < 1e-3,
        "a full deflection is the reach: {:?}",
        bench.place_m
    );
}

#[test]
fn the_lift_follows_stick_and_triggers_within_the_reach() {
    let mut bench = Bench::new(Hardware::Gamepad);
    bench.press(SOUTH);
    bench.run(100).unwrap();
    bench.axis(RZ, 1000);
    bench.run(500).unwrap();
    assert!(
        (bench.place_m[2] + 0.02).abs() < 1e-9,
        "{:?}",
        bench.place_m
    );
    bench.axis(RZ, 0);
    bench.run(500).unwrap();
    assert!(bench.place_m[2].abs() < 1e-9, "let go of, the tool rises");
}

#[test]
fn the_clutch_moves_the_stick_without_the_handle_and_only_whoever_held_goes_on() {
    let mut bench = Bench::new(Hardware::Gamepad);
    bench.press(SHOULDER);
    bench.run(50).unwrap();
    bench.lift(SHOULDER);
    bench.run(50).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Released);
    bench.press(SOUTH);
    bench.axis(X, 1000);
    bench.run(1500).unwrap();
    let before_m = bench.place_m[0];
    bench.press(SHOULDER);
    bench.run(200).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Clutched);
    bench.axis(X, 0);
    bench.run(500).unwrap();
    bench.lift(SHOULDER);
    bench.run(500).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Held);
    assert!(
        (bench.place_m[0] - before_m).abs() < 1e-3,
        "{before_m} to {:?}",
        bench.place_m
    );
}

#[test]
fn fresh_clay_is_asked_for_once_a_press() {
    let mut bench = Bench::new(Hardware::Gamepad);
    bench.press(START);
    bench.run(50).unwrap();
    assert!(bench.coupled.poll_wants_clay());
    bench.run(50).unwrap();
    assert!(!bench.coupled.poll_wants_clay());
}

#[test]
fn a_gamepad_shows_force_as_rumble_and_a_joystick_pushes_back_along_two_axes() {
    let mut pad = Bench::new(Hardware::Gamepad);
    pad.wall_n_per_m = 400.0;
    pad.press(SOUTH);
    pad.run(50).unwrap();
    pad.axis(X, 1000);
    pad.run(800).unwrap();
    assert!(
        1.0 < pad.force_n(),
        "a hand without motors still pushes the loop's handle"
    );
    let shown = pad.port.script().rendered;
    assert!(
        matches!(
            shown,
            Some(Effect::Rumble {
                strong: 10_000..,
                ..
            })
        ),
        "{shown:?}"
    );
    let is_rumble = |effect: &Effect| matches!(effect, Effect::Rumble { .. });
    assert!(pad.port.script().played.iter().all(is_rumble));
    pad.press(EAST);
    pad.run(50).unwrap();
    assert_eq!(
        pad.port.script().rendered,
        None,
        "a hand that lets go is shown nothing"
    );

    let mut stick = Bench::new(Hardware::Joystick);
    stick.wall_n_per_m = 400.0;
    stick.press(TRIGGER);
    stick.run(50).unwrap();
    stick.push();
    stick.run(800).unwrap();
    let rendered = stick.port.script().rendered.unwrap();
    let Effect::Constant { direction, level } = rendered else {
        panic!("{rendered:?}");
    };
    // The hand went right, against a wall: it is pushed to the left.
    assert!(0 < level && direction.abs_diff(0x4000) < 8, "{rendered:?}");
}

#[test]
fn effects_are_renewed_125_times_a_second_at_most_and_end_at_once() {
    let mut bench = Bench::new(Hardware::Joystick);
    bench.wall_n_per_m = 400.0;
    bench.press(TRIGGER);
    bench.run(50).unwrap();
    bench.push();
    for step in 0..450 {
        bench.axis(X, if step % 2 == 0 { 1000 } else { 950 });
        bench.run(2).unwrap();
    }
    let played = bench.port.script().played.len() as u64;
    assert!(50 < played && played <= 1050 * MS / RENEW_NS, "{played}");
    bench.press(THUMB2);
    bench.run(150).unwrap();
    assert_eq!(bench.port.script().rendered, None);
}

#[test]
fn a_device_that_is_unplugged_ends_in_words_and_without_force() {
    for hardware in [Hardware::Gamepad, Hardware::Joystick] {
        for failure in [
            PortError::Unplugged,
            PortError::NoPermission,
            PortError::Other("the bus".to_owned()),
        ] {
            let mut bench = Bench::new(hardware);
            bench.wall_n_per_m = 400.0;
            bench.press(if hardware == Hardware::Gamepad {
                SOUTH
            } else {
                TRIGGER
            });
            bench.run(50).unwrap();
            bench.push();
            bench.run(400).unwrap();
            assert!(bench.port.script().rendered.is_some());
            bench.port.script().failure = Some(failure.clone());
            let fault = bench.run(10).unwrap_err();
            bench.driver.rest();
            assert_eq!(bench.port.script().rendered, None);
            let said = fault.to_string();
            assert_eq!(said, format!("the {} is lost: {failure}", hardware.word()));
            bench.ends.end(fault.clone());
            assert_eq!(bench.tick(), Err(fault));
        }
    }
}

#[test]
fn events_that_were_dropped_are_read_anew_and_the_hand_takes_hold_anew() {
    let mut bench = Bench::new(Hardware::Gamepad);
    bench.press(SOUTH);
    bench.run(50).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Held);
    {
        let mut script = bench.port.script();
        script.state.axes[0].value = 1000;
        script.state.down = vec![SOUTH];
        script.events.push(PadEvent::Dropped);
        // What follows in the same batch is worth nothing.
        script.events.push(PadEvent::Axis {
            code: X,
            value: -1000,
        });
    }
    bench.run(500).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Released);
    assert!(bench.place_m[0].abs() < 2e-3, "{:?}", bench.place_m);
    bench.lift(SOUTH);
    bench.press(SOUTH);
    bench.run(50).unwrap();
    bench.axis(X, 0);
    bench.run(1000).unwrap();
    // From right to the middle: the state that was read said right.
    assert!(bench.place_m[0] < -0.03, "{:?}", bench.place_m);
}

#[test]
fn a_driver_that_is_late_lets_go_gently_and_one_that_slept_has_to_be_taken_hold_of_anew() {
    let mut bench = Bench::new(Hardware::Joystick);
    bench.wall_n_per_m = 400.0;
    bench.press(TRIGGER);
    bench.run(50).unwrap();
    bench.push();
    bench.run(600).unwrap();
    let mut last_n = bench.force_n();
    assert!(0.5 < last_n);
    // The driver stands still for 120 ms, the tick goes on.
    for _ in 0..120 {
        bench.tick().unwrap();
        let force_n = bench.force_n();
        assert!(
            (force_n - last_n).abs() <= 200.0 * 1e-3 + 1e-9,
            "no step in the force"
        );
        last_n = force_n;
        bench.now_ns += MS;
    }
    assert!(last_n <= 0.0);
    bench.run(100).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Held, "late, and back");
    bench.slept_ns = 3_600_000 * MS;
    bench.run(200).unwrap();
    assert_eq!(
        bench.coupled.state(),
        GraspState::Released,
        "it slept for an hour"
    );
    assert_eq!(bench.port.script().rendered, None);
    bench.run(1000).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Released);
    bench.lift(TRIGGER);
    bench.press(TRIGGER);
    bench.run(50).unwrap();
    assert_eq!(bench.coupled.state(), GraspState::Held);
}

#[test]
fn a_driver_that_was_silent_for_a_quarter_of_a_second_has_to_be_taken_hold_of_anew() {
    for (silent_ms, state) in [(200, GraspState::Held), (260, GraspState::Released)] {
        let mut bench = Bench::new(Hardware::Gamepad);
        bench.press(SOUTH);
        bench.run(100).unwrap();
        for _ in 0..silent_ms {
            bench.tick().unwrap();
            bench.now_ns += MS;
        }
        bench.run(200).unwrap();
        assert_eq!(bench.coupled.state(), state, "after {silent_ms} ms");
    }
}

#[test]
fn a_tick_that_stops_leaves_the_stick_without_force() {
    let mut bench = Bench::new(Hardware::Joystick);
    bench.wall_n_per_m = 400.0;
    bench.press(TRIGGER);
    bench.run(50).unwrap();
    bench.push();
    bench.run(400).unwrap();
    assert!(bench.port.script().rendered.is_some());
    for _ in 0..8 {
        bench.now_ns += 4 * MS;
        bench.drive().unwrap();
    }
    assert_eq!(bench.port.script().rendered, None);
}

#[test]
fn a_driver_that_hangs_is_a_lost_device_after_two_seconds() {
    let mut bench = Bench::new(Hardware::Gamepad);
    bench.run(10).unwrap();
    let fault = loop {
        bench.now_ns += MS;
        if let Err(fault) = bench.tick() {
            break fault;
        }
    };
    assert_eq!(
        fault.to_string(),
        "the gamepad is lost: it was silent for two seconds"
    );
    assert!(bench.now_ns < 2100 * MS);
}

#[test]
fn a_joystick_without_constant_force_is_refused_by_name() {
    let mut port = StandIn::new(Hardware::Joystick);
    port.nature.pushes = false;
    let fault = PadDriver::new(Hardware::Joystick, port, &NEEDS).unwrap_err();
    assert!(
        fault
            .to_string()
            .starts_with("the joystick `stand-in` at /dev/input has no constant force"),
        "{fault}"
    );
}

fn events() -> impl Strategy<Value = PadEvent> {
    let code = prop_oneof![
        Just(X),
        Just(Y),
        Just(RY),
        Just(RZ),
        Just(THROTTLE),
        Just(SOUTH),
        Just(EAST),
        Just(SHOULDER),
        Just(TRIGGER),
        any::<u16>()
    ];
    prop_oneof![
        4 => (code.clone(), any::<i32>()).prop_map(|(code, value)| PadEvent::Axis { code, value }),
        4 => (code.clone(), -1000..1000_i32)
            .prop_map(|(code, value)| PadEvent::Axis { code, value }),
        4 => (code, any::<bool>()).prop_map(|(code, is_down)| PadEvent::Key { code, is_down }),
        1 => Just(PadEvent::Dropped),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever a device says, the hand meets no more than the profile, no place leaps, and the end is without force.
    #[test]
    fn no_garbage_passes_the_profile(
        is_pad in any::<bool>(),
        wall_n_per_m in 0.0..2000.0_f64,
        batches in prop::collection::vec(prop::collection::vec(events(), 0..6), 1..120),
    ) {
        let hardware = if is_pad { Hardware::Gamepad } else { Hardware::Joystick };
        let profile = hardware.profile();
        let mut bench = Bench::new(hardware);
        bench.wall_n_per_m = wall_n_per_m;
        bench.press(if is_pad { SOUTH } else { TRIGGER });
        let mut last_n = [0.0; 3];
        for batch in batches {
            bench.port.script().events.extend(batch);
            for _ in 0..8 {
                bench.run(1).unwrap();
                prop_assert!(bench.hand_force_n.iter().all(|part| part.is_finite()));
                prop_assert!(bench.force_n() <= profile.force_n + 1e-9);
                for axis in 0..3 {
                    let step = (bench.hand_force_n[axis] - last_n[axis]).abs();
                    prop_assert!(step <= profile.slew_n_per_s * 1e-3 + 1e-9, "{} N in a tick", step);
                }
                last_n = bench.hand_force_n;
                let Some(Effect::Constant { level, .. }) = bench.port.script().rendered else {
                    continue;
                };
                prop_assert!(level <= i16::MAX / 5 + 1, "{}", level);
            }
        }
        bench.coupled.let_go();
        for _ in 0..(200 + 8) {
            let _ = bench.run(1);
            bench.port.script().events.clear();
            bench.coupled.let_go();
        }
        prop_assert!(bench.force_n() <= 0.0);
        let rendered = bench.port.script().rendered;
        prop_assert!(rendered.is_none_or(is_nothing), "{:?}", rendered);
    }

    /// A gamepad's place is never faster than its coupling believes.
    #[test]
    fn a_place_never_leaps(values in prop::collection::vec((any::<i32>(), any::<i32>()), 1..200)) {
        let port = StandIn::new(Hardware::Gamepad);
        let mut driver = PadDriver::new(Hardware::Gamepad, port.clone(), &NEEDS).unwrap();
        let mut last_m = driver.step(0, [0.0; 3]).unwrap().unwrap().position_m;
        for (step, (x, y)) in (1_u64..).zip(values) {
            let axis = |code, value| PadEvent::Axis { code, value };
            port.script().events.extend([axis(X, x), axis(RY, y)]);
            let news = driver.step(step * 4 * MS, [0.0; 3]).unwrap().unwrap();
            let way: f64 = (0..3).map(|axis| (news.position_m[axis] - last_m[axis]).powi(2)).sum();
            prop_assert!(way.sqrt() <= FOLLOWS_M_S * 0.004 + 1e-12);
            last_m = news.position_m;
        }
    }
}
