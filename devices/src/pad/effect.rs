//! From a force to what a motor is told.
//!
//! No driver says how many newtons a full level is. A joystick's full level is taken for 10 N, and never asked for: its
//! profile ends at 2 N, a fifth of the level. What a strong stick makes of a fifth is stronger than 2 N.

use super::port::Effect;

/// What a full level is taken for, N.
pub const FULL_LEVEL_N: f64 = 10.0;
/// An effect that is not renewed ends by itself after this, ms: a driver that hangs leaves a device without force.
pub const LASTS_MS: u16 = 200;
/// An effect is renewed no more often than this, ns: 125 times a second, half of what a device takes at best.
pub const RENEW_NS: u64 = 8_000_000;
/// And at least as often as this, ns, half of what it lasts.
pub const RENEW_WITHIN_NS: u64 = 100_000_000;

/// Rumble that shows the size of a force: both motors in proportion, all of it at `most_n`.
#[must_use]
pub fn rumble(force_n: [f64; 3], most_n: f64) -> Effect {
    let strength = share(size(&force_n), most_n) * f64::from(u16::MAX);
    let strength = strength as u16;
    Effect::Rumble {
        strong: strength,
        weak: strength / 2,
    }
}

/// A push along x and y. x is to the right, y away from the hand.
#[must_use]
pub fn constant(force_n: [f64; 3]) -> Effect {
    let [x, y, _] = force_n;
    let size_n = size(&[x, y]);
    let level = (share(size_n, FULL_LEVEL_N) * f64::from(i16::MAX)) as i16;
    if level <= 0 {
        return Effect::Constant {
            direction: 0,
            level: 0,
        };
    }
    // Turns from towards the hand, by way of left.
    let turns = (-x).atan2(-y) / std::f64::consts::TAU;
    let direction = (turns.rem_euclid(1.0) * 65536.0).round() as u32 as u16;
    Effect::Constant { direction, level }
}

/// Whether an effect renders nothing.
#[must_use]
pub fn is_nothing(effect: Effect) -> bool {
    match effect {
        Effect::Rumble { strong, weak } => strong == 0 && weak == 0,
        Effect::Constant { level, .. } => level == 0,
    }
}

fn size(force_n: &[f64]) -> f64 {
    force_n.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// From 0 to 1; a force that is no number is none.
fn share(size_n: f64, most_n: f64) -> f64 {
    if size_n.is_finite() {
        (size_n / most_n).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_push_goes_where_the_force_goes() {
        let directions = [
            ([0.0, -2.0, 0.0], 0x0000),
            ([-2.0, 0.0, 0.0], 0x4000),
            ([0.0, 2.0, 0.0], 0x8000),
            ([2.0, 0.0, 0.0], 0xc000),
            ([2.0, -2.0, 0.0], 0xe000),
        ];
        for (force_n, want) in directions {
            let Effect::Constant { direction, .. } = constant(force_n) else {
                panic!("a constant force");
            };
            assert_eq!(direction, want, "{force_n:?}");
        }
    }

    #[test]
    fn two_newtons_are_a_fifth_of_the_level_and_a_number_that_is_none_is_nothing() {
        let level = |force_n| match constant(force_n) {
            Effect::Constant { level, .. } => level,
            Effect::Rumble { .. } => panic!("a constant force"),
        };
        assert_eq!(level([0.0, 2.0, 0.0]), i16::MAX / 5);
        assert_eq!(level([1e9, 0.0, 0.0]), i16::MAX);
        assert_eq!(level([f64::NAN, 2.0, 0.0]), 0);
        assert_eq!(level([0.0, 0.0, 2.0]), 0, "a stick has no third motor");
        assert!(is_nothing(constant([0.0; 3])) && is_nothing(rumble([0.0; 3], 5.0)));
    }

    #[test]
    fn rumble_grows_with_the_force_to_all_there_is() {
        let strong = |force_n: f64| match rumble([0.0, 0.0, -force_n], 5.0) {
            Effect::Rumble { strong, .. } => strong,
            Effect::Constant { .. } => panic!("rumble"),
        };
        assert!(strong(0.1) < strong(1.0) && strong(1.0) < strong(4.9));
        assert_eq!((strong(5.0), strong(50.0)), (u16::MAX, u16::MAX));
        assert_eq!(strong(f64::INFINITY), 0);
    }
}
