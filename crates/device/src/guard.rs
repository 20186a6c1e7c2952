//! The handle's own law: what a device does to the hand at most, whatever scheme, session or server asks for.
//!
//! The guard is the last thing that a command passes before the device. It knows no server and no scheme; so nothing
//! that comes over a wire can widen it.

use crate::DeviceCommand;

/// What a device may do to the hand that holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceProfile {
    /// Greatest force, N.
    pub force_n: f64,
    /// Greatest change of the force, N/s.
    pub slew_n_per_s: f64,
    /// Greatest speed at which the handle is sent anywhere, m/s.
    pub speed_m_s: f64,
    /// Greatest power that force and commanded motion bring into the hand together, W.
    pub power_w: f64,
    /// Longest silence of the far side after which it lets go of the hand, s.
    pub silence_s: f64,
    /// Longest time that letting go takes, s.
    pub ramp_s: f64,
}

impl DeviceProfile {
    /// The lower bound of the two, one by one.
    #[must_use]
    pub fn lowered_to(self, other: Self) -> Self {
        Self {
            force_n: self.force_n.min(other.force_n),
            slew_n_per_s: self.slew_n_per_s.min(other.slew_n_per_s),
            speed_m_s: self.speed_m_s.min(other.speed_m_s),
            power_w: self.power_w.min(other.power_w),
            silence_s: self.silence_s.min(other.silence_s),
            ramp_s: self.ramp_s.min(other.ramp_s),
        }
    }
}

/// Holds every command to a profile. The two times of the profile are the loop's to keep.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    profile: DeviceProfile,
    tick_s: f64,
    /// What the device was told last.
    last: Option<DeviceCommand>,
}

impl Guard {
    /// For a device at rest without force.
    #[must_use]
    pub fn new(profile: DeviceProfile, tick_s: f64) -> Self {
        Self {
            profile,
            tick_s,
            last: None,
        }
    }

    /// What the device may be told of `wanted`, where its handle is at `position_m` before the first command.
    ///
    /// The force is capped, and from the last one on changes no faster than the slew. The way from the last command is
    /// no longer than the speed allows, and shorter where force and motion together would bring more power into the
    /// hand than there may be. A place or a force that is no number counts as the last place, and as no force.
    pub fn step(&mut self, wanted: DeviceCommand, position_m: [f64; 3]) -> DeviceCommand {
        let last = self.last.unwrap_or(DeviceCommand {
            position_m: finite(position_m).unwrap_or_default(),
            force_n: [0.0; 3],
        });
        let force = capped(
            finite(wanted.force_n).unwrap_or_default(),
            self.profile.force_n,
        );
        let change = capped(
            minus(force, last.force_n),
            self.profile.slew_n_per_s * self.tick_s,
        );
        // Rounding must not carry the force past its cap.
        let force = capped(plus(last.force_n, change), self.profile.force_n);

        let place = finite(wanted.position_m).unwrap_or(last.position_m);
        let wanted_way = minus(place, last.position_m);
        let mut way = capped(wanted_way, self.profile.speed_m_s * self.tick_s);
        let work_j = dot(force, way);
        let most_j = self.profile.power_w * self.tick_s;
        if most_j < work_j {
            way = way.map(|part| part * (most_j / work_j));
        }
        let is_whole = (0..3).all(|axis| way[axis].to_bits() == wanted_way[axis].to_bits());
        let told = DeviceCommand {
            // A command within the bounds is passed on to the last bit.
            position_m: if is_whole {
                place
            } else {
                plus(last.position_m, way)
            },
            force_n: force,
        };
        self.last = Some(told);
        told
    }
}

fn finite(v: [f64; 3]) -> Option<[f64; 3]> {
    v.iter().all(|part| part.is_finite()).then_some(v)
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `v`, shortened to length `most` where it is longer.
fn capped(v: [f64; 3], most: f64) -> [f64; 3] {
    // Divided first, so that no square is too large for a number.
    let largest = v
        .iter()
        .fold(0.0_f64, |largest, part| largest.max(part.abs()));
    if largest <= 0.0 {
        return v;
    }
    let scaled = v.map(|part| part / largest);
    let length = dot(scaled, scaled).sqrt();
    if largest <= most / length {
        v
    } else {
        scaled.map(|part| part * (most / length))
    }
}
