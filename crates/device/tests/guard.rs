//! Whatever a device is told to do, the hand that holds it meets no more than the device's own profile.

#![allow(
    clippy::float_cmp,
    reason = "no force is zero, and a command that is let pass is the same"
)]

use proptest::prelude::*;
use teleclay_device::{DeviceCommand, DeviceProfile, Guard};

const TICK_S: f64 = 1e-3;
const PROFILE: DeviceProfile = DeviceProfile {
    force_n: 20.0,
    slew_n_per_s: 2000.0,
    speed_m_s: 2.0,
    power_w: 15.0,
    silence_s: 0.1,
    ramp_s: 0.05,
};
/// What rounding may add, over the bound.
const ROUNDING: f64 = 1.0 + 1e-12;

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|part| part * part).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// Any number there is, and often ones that a loop could mean.
fn part(scale: f64) -> impl Strategy<Value = f64> {
    prop_oneof![6 => -scale..scale, 1 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(0.0)]
}

fn command() -> impl Strategy<Value = DeviceCommand> {
    let vector = |scale| proptest::array::uniform3(part(scale));
    let scales = prop_oneof![Just((0.01, 5.0)), Just((0.5, 50.0)), Just((1e9, 1e9))];
    scales.prop_flat_map(move |(position, force)| {
        (vector(position), vector(force)).prop_map(|(position_m, force_n)| DeviceCommand {
            position_m,
            force_n,
        })
    })
}

fn assert_within(profile: &DeviceProfile, told: &DeviceCommand, last: &DeviceCommand) {
    let way_m = minus(told.position_m, last.position_m);
    let change_n = minus(told.force_n, last.force_n);
    let power_w = told
        .force_n
        .iter()
        .zip(way_m)
        .map(|(f, way)| f * way)
        .sum::<f64>()
        / TICK_S;
    // The way is the difference of two places, and exact to the rounding of these.
    let slack_m = 1e-12 * norm(told.position_m).max(norm(last.position_m));
    assert!(norm(told.force_n) <= profile.force_n * ROUNDING, "{told:?}");
    assert!(
        norm(change_n) <= profile.slew_n_per_s * TICK_S * ROUNDING + 1e-12,
        "{told:?} after {last:?}"
    );
    assert!(
        norm(way_m) <= profile.speed_m_s * TICK_S * ROUNDING + slack_m,
        "{told:?} after {last:?}"
    );
    let slack_w = profile.force_n * slack_m / TICK_S;
    assert!(
        power_w <= profile.power_w * ROUNDING + slack_w,
        "{told:?} after {last:?}: {power_w} W"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_sequence_of_commands_passes_the_profile(
        commands in proptest::collection::vec(command(), 1..200), at in proptest::array::uniform3(-0.1..0.1f64),
    ) {
        let mut guard = Guard::new(PROFILE, TICK_S);
        let mut last = DeviceCommand { position_m: at, force_n: [0.0; 3] };
        for wanted in commands {
            let told = guard.step(wanted, at);
            assert_within(&PROFILE, &told, &last);
            last = told;
        }
    }

    /// What keeps to the profile by itself is passed on as it is, to the last bit.
    #[test]
    fn what_is_within_the_profile_is_not_touched(
        ways in proptest::collection::vec(proptest::array::uniform3(-1e-3..1e-3f64), 1..200),
        changes in proptest::collection::vec(proptest::array::uniform3(-0.01..0.01f64), 200),
    ) {
        let mut guard = Guard::new(PROFILE, TICK_S);
        let mut wanted = DeviceCommand::default();
        for (way, change) in ways.iter().zip(&changes) {
            for axis in 0..3 {
                wanted.position_m[axis] += way[axis];
                wanted.force_n[axis] += change[axis];
            }
            prop_assert_eq!(guard.step(wanted, [0.0; 3]), wanted);
        }
    }
}

#[test]
fn each_bound_binds_by_itself() {
    let far = DeviceCommand {
        position_m: [1.0, 0.0, 0.0],
        force_n: [1000.0, 0.0, 0.0],
    };
    let against = DeviceCommand {
        position_m: [-1.0, 0.0, 0.0],
        ..far
    };
    let mut guard = Guard::new(PROFILE, TICK_S);
    // Force rises by the slew, to its cap; against the force the handle moves as fast as it may.
    for tick in 1..=20 {
        let told = guard.step(against, [0.0; 3]);
        assert!(
            (told.force_n[0] - f64::from(tick.min(10)) * 2.0).abs() < 1e-9,
            "{told:?}"
        );
        assert!(
            (told.position_m[0] + f64::from(tick) * 2e-3).abs() < 1e-9,
            "{told:?}"
        );
    }
    // With the force, 20 N and 15 W leave 0.75 m/s.
    let before_m = guard.step(against, [0.0; 3]).position_m[0];
    let way_m = guard.step(far, [0.0; 3]).position_m[0] - before_m;
    assert!((way_m - 0.75e-3).abs() < 1e-9, "{way_m}");
    // What is no number asks for no force, and for no way.
    let nothing = DeviceCommand {
        position_m: [f64::NAN; 3],
        force_n: [f64::NAN; 3],
    };
    let last_m = guard.step(nothing, [0.0; 3]).position_m;
    for _ in 0..20 {
        let told = guard.step(nothing, [0.0; 3]);
        assert_eq!(told.position_m, last_m);
    }
    assert_eq!(guard.step(nothing, [0.0; 3]).force_n, [0.0; 3]);
}

/// The first command is held to where the handle is, not to home.
#[test]
fn a_device_that_is_away_from_home_is_not_thrown_there() {
    let mut guard = Guard::new(PROFILE, TICK_S);
    let told = guard.step(DeviceCommand::default(), [0.1, 0.0, 0.0]);
    assert!((told.position_m[0] - 0.098).abs() < 1e-12, "{told:?}");
}

#[test]
fn a_profile_is_only_lowered() {
    let lower = DeviceProfile {
        force_n: 5.0,
        slew_n_per_s: 1e9,
        speed_m_s: 0.1,
        power_w: f64::INFINITY,
        silence_s: 0.02,
        ramp_s: 10.0,
    };
    let lowered = PROFILE.lowered_to(lower);
    let wanted = DeviceProfile {
        force_n: 5.0,
        speed_m_s: 0.1,
        silence_s: 0.02,
        ..PROFILE
    };
    assert_eq!(lowered, wanted);
}
