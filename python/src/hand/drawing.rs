//! What the law intends, as the place of a device: so it passes the coupling and the guard of every other hand.
//!
//! ```text
//! a place x, as stiff as k <= K:   p = y_h + (k / K) (x - y_h)
//! a force f:                       p = y_h + f / K
//! ```
//!
//! `K` is the coupling's own spring, `y_h` the handle, where it will be when the place is played. Whatever is intended,
//! `p` moves no faster than [`FASTEST_M_S`], so that nothing that a law says is a leap.

use std::collections::VecDeque;

use teleclay_impedance::GraspState;
use teleclay_pointer::{Pointer, View};

use super::conversation::RATE_HZ;

/// Half of what a coupling takes for a leap.
const FASTEST_M_S: f64 = 0.5;
/// A coupling plays a device's places this much later, s: an interval at [`RATE_HZ`].
const PLAYED_LATER_S: f64 = 1.0 / RATE_HZ;
/// Places told that are remembered: more than are told while one is waiting to be played.
const REMEMBERED: usize = 64;
/// How fast what the grip is off by is made up for, m/s.
const MADE_UP_M_S: f64 = 0.1;
/// The handle counts as at rest below this, m/s: what it moves during a sample's play is then less than 20 µm.
const AT_REST_M_S: f64 = 2e-3;
/// A handle that does not come to rest is taken hold of all the same after this, s.
const LONGEST_WAIT_S: f64 = 0.5;

/// What a law intends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Intent {
    /// Nothing: the hand is off.
    Off,
    /// To be there, by a spring of so much at most.
    Place {
        position_m: [f64; 3],
        stiffness_n_per_m: f64,
    },
    /// To push.
    Push { force_n: [f64; 3] },
}

/// The device that the law moves.
pub(super) struct Drawing {
    intent: Intent,
    /// Where the hand shall draw the handle to, and since when, ns.
    place_m: [f64; 3],
    at_ns: u64,
    /// What of that the grip does by itself: a handle that moved as it was taken hold of is drawn beside the device.
    grip_m: [f64; 3],
    /// Where the device was said to be, and when, ns; oldest first.
    told: VecDeque<(u64, [f64; 3])>,
    waits_since_ns: Option<u64>,
    /// The third axis is a lift, which no force moves.
    has_lift: bool,
}

impl Drawing {
    pub(super) fn new(now_ns: u64, has_lift: bool) -> Self {
        Self {
            intent: Intent::Off,
            place_m: [0.0; 3],
            at_ns: now_ns,
            grip_m: [0.0; 3],
            told: VecDeque::with_capacity(REMEMBERED),
            waits_since_ns: None,
            has_lift,
        }
    }

    pub(super) fn intend(&mut self, intent: Intent) {
        self.intent = intent;
    }

    /// Tells the pointer where the device is at `now_ns`, and takes hold or lets go.
    pub(super) fn draw(&mut self, now_ns: u64, pointer: &mut Pointer) {
        let since_s = now_ns.saturating_sub(self.at_ns) as f64 * 1e-9;
        self.at_ns = now_ns;
        let view = *pointer.view();
        if view.grasp != GraspState::Held {
            self.grip_m = [0.0; 3];
        }
        if self.intent == Intent::Off {
            self.waits_since_ns = None;
            if view.grasp != GraspState::Released {
                pointer.release();
            }
            self.place_m = view.handle_m;
        } else if view.grasp == GraspState::Held {
            self.waits_since_ns = None;
            let velocity_m_s = pointer.side().frame().velocity_m_s;
            let handle = std::array::from_fn(|axis| {
                view.handle_m[axis] + PLAYED_LATER_S * velocity_m_s[axis]
            });
            let wanted = self.wanted(handle, pointer.stiffness_n_per_m());
            self.place_m = towards(self.place_m, wanted, FASTEST_M_S * since_s);
            if let Some(grip_m) = self.grip(&view) {
                self.grip_m = towards(self.grip_m, grip_m, MADE_UP_M_S * since_s);
            }
        } else {
            // The grip is closed with the device at the handle, so that places are the handle's own.
            let velocity_m_s = pointer.side().frame().velocity_m_s;
            let waits_s =
                now_ns.saturating_sub(*self.waits_since_ns.get_or_insert(now_ns)) as f64 * 1e-9;
            self.place_m = view.handle_m;
            if norm(velocity_m_s) < AT_REST_M_S || LONGEST_WAIT_S < waits_s {
                pointer.hold();
            }
        }
        let told_m = std::array::from_fn(|axis| self.place_m[axis] - self.grip_m[axis]);
        if self.told.len() == REMEMBERED {
            self.told.pop_front();
        }
        self.told.push_back((now_ns, told_m));
        pointer.handle_sample(now_ns, now_ns, told_m);
    }

    /// Where the handle is drawn to, less the place that is being played: constant while the handle is held.
    fn grip(&self, view: &View) -> Option<[f64; 3]> {
        let played_ns = view.at_ns.checked_sub((PLAYED_LATER_S * 1e9) as u64)?;
        let after = self.told.iter().position(|(at_ns, _)| played_ns < *at_ns)?;
        let (from_ns, from_m) = *self.told.get(after.checked_sub(1)?)?;
        let (to_ns, to_m) = *self.told.get(after)?;
        let share = (played_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
        Some(std::array::from_fn(|axis| {
            view.hand_m[axis] - (from_m[axis] + share * (to_m[axis] - from_m[axis]))
        }))
    }

    fn wanted(&self, handle: [f64; 3], stiffest_n_per_m: f64) -> [f64; 3] {
        match self.intent {
            Intent::Off => handle,
            Intent::Place {
                position_m,
                stiffness_n_per_m,
            } => {
                let share = (stiffness_n_per_m / stiffest_n_per_m).clamp(0.0, 1.0);
                std::array::from_fn(|axis| {
                    // A lift goes where it is told: no spring draws it.
                    let share = if self.is_lift(axis) { 1.0 } else { share };
                    handle[axis] + share * (position_m[axis] - handle[axis])
                })
            }
            Intent::Push { force_n } => std::array::from_fn(|axis| {
                if self.is_lift(axis) {
                    self.place_m[axis]
                } else {
                    handle[axis] + force_n[axis] / stiffest_n_per_m
                }
            }),
        }
    }

    fn is_lift(&self, axis: usize) -> bool {
        self.has_lift && axis == 2
    }
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// From one place towards another, by so much at most.
fn towards(from: [f64; 3], to: [f64; 3], most_m: f64) -> [f64; 3] {
    let way: [f64; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
    let length_m = norm(way);
    if length_m <= most_m {
        return to;
    }
    std::array::from_fn(|axis| from[axis] + way[axis] * (most_m / length_m))
}
