//! Energy as it is counted: tanks that are never overdrawn on purpose, cumulative counters from a peer, and an observer
//! that looks at a channel from outside.
//!
//! Positive work goes *into* the channel. Over one tick a force is held while a port moves by a displacement, so the
//! work is their product and no velocity has to be guessed: at the handle `-felt · d`, at the clay `-f_t · d`. Energies
//! are joules of the handle's port; a clay's joule is divided by `A_h1 |A_h2|`, the power ratio of the two ports.

use crate::Vec3;

/// Energy that may be spent, up to a cap. What is above the cap is somebody else's, or lost.
#[derive(Clone, Copy, Debug)]
pub struct Tank {
    level_j: f64,
    most_j: f64,
}

impl Tank {
    /// An empty tank that holds `most_j`.
    pub const fn empty(most_j: f64) -> Self {
        Self {
            level_j: 0.0,
            most_j,
        }
    }

    /// Puts energy in, or takes it out where it has already gone: then the level may fall below zero, and what comes
    /// next fills the hole first. Returns what did not fit, J.
    pub fn settle(&mut self, energy_j: f64) -> f64 {
        let level = self.level_j + energy_j;
        self.level_j = level.min(self.most_j);
        level - self.level_j
    }

    /// The level, J. Below zero when more was spent than there was.
    pub const fn level_j(&self) -> f64 {
        self.level_j
    }

    /// What may be spent, J: never below zero.
    pub const fn at_hand_j(&self) -> f64 {
        self.level_j.max(0.0)
    }
}

/// Follows a cumulative energy that a peer sends with its frames, newest only. Whatever is lost or overtaken is in the
/// next value.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counter {
    last_j: Option<f64>,
}

impl Counter {
    /// Nothing received yet.
    pub const NEW: Self = Self { last_j: None };

    /// What came since the last value, J. The first value is where counting starts; one below the last says that the
    /// peer has started anew, and is a start as well.
    pub fn increment_j(&mut self, total_j: f64) -> f64 {
        let last = self.last_j.replace(total_j).unwrap_or(total_j);
        (total_j - last).max(0.0)
    }
}

/// Looks at a channel from outside: what went in at the hand's end less what came out at the clay's, from true
/// displacements.
///
/// A passive channel that starts at rest never gives more than it got, so its energy never falls below zero.
///
/// A scheme that reckons with samples sees the power `F v` of an instant. The true work of a tick is `F d`, with
/// `d = v T + a T² / 2` for an acceleration `a`: sample and truth part by `F a T² / 2`, half a tick of the force's
/// delay. A spring of stiffness `K` that is reckoned with so seems passive and gives `K v² T / 2` a second.
#[derive(Clone, Copy, Debug)]
pub struct Observer {
    power_ratio: f64,
    energy_j: f64,
    least_j: f64,
}

impl Observer {
    /// At rest. `power_ratio` is `A_h1 |A_h2|`, clay's joules for one of the handle's.
    pub const fn new(power_ratio: f64) -> Self {
        Self {
            power_ratio,
            energy_j: 0.0,
            least_j: 0.0,
        }
    }

    /// The hand felt `felt`, N, while the handle moved by `displacement`, m.
    pub fn on_hand(&mut self, felt: Vec3, displacement: Vec3) {
        self.add(-felt.dot(&displacement));
    }

    /// The tool moved by `displacement`, m, and the clay answered with `clay_force`, N.
    pub fn on_clay(&mut self, clay_force: Vec3, displacement: Vec3) {
        self.add(clay_force.dot(&displacement) / self.power_ratio);
    }

    /// Energy in the channel now, J; what it dissipated counts as still in it.
    pub const fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// The least that the energy has been, J. Zero for a channel that is passive.
    pub const fn least_j(&self) -> f64 {
        self.least_j
    }

    fn add(&mut self, energy_j: f64) {
        self.energy_j += energy_j;
        self.least_j = self.least_j.min(self.energy_j);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Nothing comes out of a tank that did not go in.
        #[test]
        fn what_is_at_hand_never_exceeds_what_was_put_in(flows in prop::collection::vec(-1.0..1.0, 1..200)) {
            let mut tank = Tank::empty(0.5);
            let mut balance = 0.0;
            for flow in flows {
                balance += flow;
                balance -= tank.settle(flow);
                prop_assert!(tank.at_hand_j() <= 0.5);
                prop_assert!((tank.level_j() - balance).abs() < 1e-9);
            }
        }

        /// Losing values of a cumulative count loses nothing of the sum.
        #[test]
        fn a_counter_does_not_mind_losses(steps in prop::collection::vec((0.0..1.0, any::<bool>()), 1..200)) {
            let mut counter = Counter::default();
            let (mut total, mut counted, mut known) = (7.0, 0.0, 7.0);
            counter.increment_j(total);
            for (step, arrives) in steps {
                total += step;
                if arrives {
                    counted += counter.increment_j(total);
                    known = total;
                }
            }
            prop_assert!((counted - (known - 7.0)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_peer_that_starts_anew_gives_no_energy_and_takes_none() {
        let mut counter = Counter::default();
        let gained: Vec<f64> = [5.0, 6.0, 0.5, 0.75]
            .map(|total| counter.increment_j(total))
            .into();
        assert_eq!(gained, [0.0, 1.0, 0.0, 0.25]);
    }

    /// A held force on a handle that swings: the work of the samples differs from the true work by the half-tick term
    /// and by nothing else.
    #[test]
    fn sampled_power_misses_half_a_tick_of_acceleration() {
        const TICK_S: f64 = 1e-3;
        let (mut x, mut v) = (0.0, 0.3);
        let (mut sampled, mut missed) = (0.0, 0.0);
        let mut observer = Observer::new(1.0);
        for k in 0..500 {
            let a = -40.0 * x + (f64::from(k) * 0.05).sin();
            let force = 3.0 * x - 0.5 * v;
            let way = v * TICK_S + 0.5 * a * TICK_S * TICK_S;
            observer.on_hand(Vec3::new(-force, 0.0, 0.0), Vec3::new(way, 0.0, 0.0));
            sampled += force * v * TICK_S;
            missed += 0.5 * force * a * TICK_S * TICK_S;
            x += way;
            v += a * TICK_S;
        }
        assert!((observer.energy_j() - (sampled + missed)).abs() < 1e-12);
        assert!(1e-6 < missed.abs());
    }
}
