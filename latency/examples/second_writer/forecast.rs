//! Where another's tool is by now, told from the sweeps of it that have come: they are a round trip old.
//!
//! Sweeps carry numbers and no times. A tool that moves makes one a tick, so its velocity is the way between two of
//! them over their numbers; and the newest one is as old as the line is long. How long that is the handle knows of its
//! own exchanges with the server; the other's line is taken to be like its own.

use std::time::Duration;

use teleclay_clay::Pose;
use teleclay_link::Vec3;
use teleclay_link::replica::Cut;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::SweepRecord;

const TICK_S: f64 = 1e-3;
/// Sweeps over which a velocity is taken: two periods of a hand's tremor would be steadier and a turn later.
const WINDOW: u32 = 24;
/// Sweeps that are kept, by their numbers.
const KEPT: usize = 64;
/// A tool of which no new sweep came for so long rests.
const REST: Duration = Duration::from_millis(20);
/// Straight pieces in which a bent way is cut.
const PIECES: u32 = 4;
/// A change of velocity is carried on for so long at most, s: no hand keeps one up for longer.
const BEND_S: f64 = 0.15;
/// A forecast may be off by so much before less is foreseen, m: a voxel.
const OFF_M: f64 = 1e-3;
/// Share of a sweep's lateness that goes into what is taken for the time of its making: what is left of a line's jitter
/// moves the forecast by a few steps of the lattice.
const CLOCK_SHARE: f64 = 1.0 / 64.0;
/// A sweep that is off by more than this and the line's own scatter was made after a rest, s.
const CLOCK_OFF_S: f64 = 0.02;
/// Forecasts that are kept until the truth of their tick comes.
const SAID: usize = 1024;

/// How the last sweeps are carried on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Law {
    /// Not at all: the replica as it is.
    None,
    /// At their velocity.
    Straight,
    /// At their velocity, no farther than this time ahead, s.
    Short(f64),
    /// At their velocity and its change.
    Bent,
    /// At a velocity that falls off with this time constant, s.
    Damped(f64),
    /// At their velocity, with a tool that is smaller by a voxel all around, so that the sides of a forecast are not
    /// felt.
    Narrow,
    /// At their velocity; clay that comes back is felt at once, and so brings no energy.
    AtOnce,
    /// Likewise, and a forecast changes the felt force by no more than this share of its range.
    Bounded(f64),
    /// At their velocity, while the tool stands before clay, as far as the copy knows.
    InContact,
    /// At their velocity, as far ahead as earlier forecasts came true within a voxel.
    Trusted,
}

impl Law {
    /// Every law, in the order in which they are shown.
    pub(crate) const ALL: [Self; 10] = [
        Self::None,
        Self::Straight,
        Self::Short(0.05),
        Self::Bent,
        Self::Damped(0.1),
        Self::Narrow,
        Self::AtOnce,
        Self::Bounded(0.07),
        Self::InContact,
        Self::Trusted,
    ];

    /// Whether the tool of the forecast is a voxel smaller all around.
    pub(crate) const fn is_narrow(self) -> bool {
        matches!(self, Self::Narrow)
    }

    /// Whether clay that comes back may bring no energy at all.
    pub(crate) const fn is_at_once(self) -> bool {
        matches!(self, Self::AtOnce | Self::Bounded(_))
    }

    /// Most by which a forecast may change the felt force, as a share of its range.
    pub(crate) const fn most_share(self) -> Option<f64> {
        match self {
            Self::Bounded(share) => Some(share),
            _ => None,
        }
    }

    /// The word for it.
    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Straight => "straight",
            Self::Short(_) => "short",
            Self::Bent => "bent",
            Self::Damped(_) => "damped",
            Self::Narrow => "narrow",
            Self::AtOnce => "at_once",
            Self::Bounded(_) => "bounded",
            Self::InContact => "in_contact",
            Self::Trusted => "trusted",
        }
    }
}

/// The forecast of one other tool.
pub(crate) struct Forecast {
    law: Law,
    kept: [Option<(u32, Pose)>; KEPT],
    newest: Option<(u32, Pose)>,
    came: Timestamp,
    round_trip_s: Option<f64>,
    /// When the sweep with number 0 would have been made, had the tool moved ever since, s.
    began_s: Option<f64>,
    /// How far sweeps' times scatter about that, s.
    scatter_s: f64,
    /// What was said of each tick.
    said: Vec<(u64, Vec3)>,
    /// By how much forecasts were off lately, m.
    off_m: f64,
}

impl Forecast {
    /// Of a tool of which nothing is known.
    pub(crate) fn new(law: Law) -> Self {
        Self {
            law,
            kept: [None; KEPT],
            newest: None,
            came: Timestamp::ZERO,
            round_trip_s: None,
            began_s: None,
            scatter_s: 0.0,
            said: vec![(0, Vec3::zeros()); SAID],
            off_m: 0.0,
        }
    }

    /// An exchange with the server took so long.
    pub(crate) fn on_round_trip(&mut self, round_trip: Duration) {
        let sample_s = round_trip.as_secs_f64();
        let smoothed_s = self.round_trip_s.unwrap_or(sample_s);
        self.round_trip_s = Some(smoothed_s + (sample_s - smoothed_s) / 64.0);
    }

    /// A sweep of the other tool came for the first time.
    pub(crate) fn on_sweep(&mut self, now: Timestamp, sweep: &SweepRecord) {
        let to = Pose::from_steps(sweep.to);
        self.kept[sweep.sequence as usize % KEPT] = Some((sweep.sequence, to));
        if self
            .newest
            .is_some_and(|(newest, _)| sweep.sequence <= newest)
        {
            return;
        }
        self.newest = Some((sweep.sequence, to));
        self.came = now;
        let Some(round_trip_s) = self.round_trip_s else {
            return;
        };
        let now_s = now.as_nanos() as f64 * 1e-9;
        let began_s = now_s - round_trip_s - f64::from(sweep.sequence) * TICK_S;
        let off_s = began_s - self.began_s.unwrap_or(began_s);
        self.began_s = match self.began_s {
            Some(before_s) if off_s.abs() < CLOCK_OFF_S + 4.0 * self.scatter_s => {
                self.scatter_s += (off_s.abs() - self.scatter_s) * CLOCK_SHARE;
                Some(before_s + off_s * CLOCK_SHARE)
            }
            _ => Some(began_s),
        };
        let made_s = self.began_s.unwrap_or(began_s) + f64::from(sweep.sequence) * TICK_S;
        let made = (made_s / TICK_S).round().max(0.0) as u64;
        let (tick, said) = self.said[made as usize % SAID];
        if tick == made && 0 < made {
            let off_m = (Vec3::from(to.position_m()) - said).norm();
            self.off_m = (self.off_m * (1.0 - TICK_S / 0.3)).max(off_m);
        }
    }

    /// The last sweep that is known, if there is one.
    pub(crate) fn newest(&self) -> Option<Pose> {
        self.newest.map(|(_, at)| at)
    }

    /// Velocity over the `span` sweeps that end `back` before the newest, m/s.
    fn velocity(&self, back: u32, span: u32) -> Option<Vec3> {
        let (newest, _) = self.newest?;
        let at = |number: u32| {
            let (known, at) = self.kept[number as usize % KEPT]?;
            (known == number).then(|| Vec3::from(at.position_m()))
        };
        let end = newest.checked_sub(back)?;
        // One of those about it will have come.
        (span..span + 8).find_map(|span| {
            let start = end.checked_sub(span)?;
            Some((at(end)? - at(start)?) / (f64::from(span) * TICK_S))
        })
    }

    /// Velocity at the newest sweep, m/s; none for a tool that rests.
    pub(crate) fn present_velocity(&self, now: Timestamp) -> Option<Vec3> {
        if REST < now.since(self.came) {
            return None;
        }
        self.velocity(0, WINDOW)
    }

    /// The way that the other tool has made since its newest sweep, as far as can be told.
    pub(crate) fn cuts(&mut self, now: Timestamp, is_in_contact: bool) -> Vec<Cut> {
        let mut cuts = Vec::new();
        let (Some((number, at)), Some(lag_s)) = (self.newest, self.round_trip_s) else {
            return cuts;
        };
        let from = Vec3::from(at.position_m());
        let Some(velocity) = self.present_velocity(now) else {
            return cuts;
        };
        let now_s = now.as_nanos() as f64 * 1e-9;
        let ahead_s = self.began_s.map_or(lag_s, |began_s| {
            now_s - began_s - f64::from(number) * TICK_S
        });
        let ahead_s = ahead_s.clamp(0.0, 2.0 * lag_s + 0.1);
        self.said[tick_of(now) as usize % SAID] = (tick_of(now), from + velocity * ahead_s);
        let ways: Vec<Vec3> = match self.law {
            Law::None => Vec::new(),
            Law::Straight | Law::Narrow | Law::AtOnce | Law::Bounded(_) => vec![velocity * ahead_s],
            Law::InContact if is_in_contact => vec![velocity * ahead_s],
            Law::InContact => Vec::new(),
            Law::Short(most_s) => vec![velocity * ahead_s.min(most_s)],
            Law::Damped(time_s) => {
                vec![velocity * (time_s * (1.0 - (-ahead_s / time_s).exp()))]
            }
            Law::Trusted => {
                let share = (OFF_M / self.off_m.max(OFF_M)).min(1.0);
                vec![velocity * (ahead_s * share)]
            }
            Law::Bent => self.bent(velocity, ahead_s),
        };
        let mut before = at;
        for way in ways {
            let Ok(to) = Pose::quantise((from + way).into()) else {
                break;
            };
            if to != before {
                cuts.push(Cut { from: before, to });
            }
            before = to;
        }
        cuts
    }

    fn bent(&self, velocity: Vec3, ahead_s: f64) -> Vec<Vec3> {
        let half = WINDOW / 2;
        let (Some(late), Some(early)) = (self.velocity(0, half), self.velocity(half, half)) else {
            return vec![velocity * ahead_s];
        };
        let change = (late - early) / (f64::from(half) * TICK_S);
        // A tool that slows down comes to rest and does not turn back.
        let slows = -change.dot(&late);
        let rest_s = if 0.0 < slows {
            late.norm_squared() / slows
        } else {
            f64::INFINITY
        };
        (1..=PIECES)
            .map(|piece| {
                let t = (ahead_s * f64::from(piece) / f64::from(PIECES)).min(rest_s);
                let bend = t.min(BEND_S);
                late * t + change * (0.5 * bend * bend + bend * (t - bend))
            })
            .collect()
    }
}

fn tick_of(now: Timestamp) -> u64 {
    now.as_nanos() / 1_000_000
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAG_TICKS: u32 = 50;

    /// A tool goes its way, and its sweeps come a round trip later; the end of what is foreseen, and where it truly is.
    fn after(law: Law, ticks: u32, way: impl Fn(f64) -> Vec3) -> (Option<Vec3>, Vec3) {
        let mut forecast = Forecast::new(law);
        let at = |tick: u32| Pose::quantise(way(f64::from(tick) * TICK_S).into()).unwrap();
        let mut number = 0;
        let mut cuts = Vec::new();
        for tick in 1..=ticks {
            let now = Timestamp::from_nanos(u64::from(tick) * 1_000_000);
            forecast.on_round_trip(Duration::from_millis(LAG_TICKS.into()));
            let made = tick.saturating_sub(LAG_TICKS);
            if 0 < made && at(made) != at(made - 1) {
                number += 1;
                let sweep = SweepRecord {
                    sequence: number,
                    from: at(made - 1).steps(),
                    to: at(made).steps(),
                };
                forecast.on_sweep(now, &sweep);
            }
            cuts = forecast.cuts(now, true);
        }
        let end = cuts.last().map(|cut| Vec3::from(cut.to.position_m()));
        (end, way(f64::from(ticks) * TICK_S))
    }

    #[test]
    fn a_steady_tool_is_foreseen_to_a_few_steps_of_the_lattice() {
        let way = |t_s: f64| Vec3::new(0.04 * t_s, -0.01 * t_s, 0.002 * t_s);
        for law in [Law::Straight, Law::Bent, Law::AtOnce, Law::Trusted] {
            let (end, there) = after(law, 400, way);
            let off_m = (end.unwrap() - there).norm();
            assert!(off_m < 5e-6, "{law:?}: {off_m} m");
        }
    }

    /// On a circle the straight way leaves it by `v h² w / 2`; that the velocity is the mean of a window, half of which
    /// is gone, adds `v h w` times that half.
    #[test]
    fn a_straight_forecast_leaves_a_circle_as_its_tangent_does() {
        let (radius_m, rate): (f64, f64) = (0.02, 2.5);
        let way = |t_s: f64| Vec3::new((rate * t_s).cos(), (rate * t_s).sin(), 0.0) * radius_m;
        let (end, there) = after(Law::Straight, 800, way);
        let ahead_s = f64::from(LAG_TICKS) * TICK_S;
        let late_s = f64::from(WINDOW) * TICK_S / 2.0;
        let wanted_m = radius_m * rate * rate * ahead_s * (ahead_s / 2.0 + late_s);
        let off_m = (end.unwrap() - there).norm();
        assert!(
            (off_m / wanted_m - 1.0).abs() < 0.05,
            "{off_m} m, wanted {wanted_m} m"
        );
    }

    #[test]
    fn a_bent_forecast_is_nearer_to_a_circle() {
        let way = |t_s: f64| Vec3::new((2.5 * t_s).cos(), (2.5 * t_s).sin(), 0.0) * 0.02;
        let [straight, bent] = [Law::Straight, Law::Bent].map(|law| {
            let (end, there) = after(law, 800, way);
            (end.unwrap() - there).norm()
        });
        assert!(bent < 0.3 * straight, "{bent} m, straight {straight} m");
    }

    /// A damped way ends at `v tau`, a short one at its time.
    #[test]
    fn ways_have_the_length_that_their_law_says() {
        let way = |t_s: f64| Vec3::new(0.05 * t_s, 0.0, 0.0);
        let ahead_s = f64::from(LAG_TICKS) * TICK_S;
        for (law, wanted_s) in [
            (Law::Short(0.02), 0.02),
            (Law::Damped(0.1), 0.1 * (1.0 - (-ahead_s / 0.1_f64).exp())),
        ] {
            let (end, there) = after(law, 400, way);
            let missing_m = (there - end.unwrap()).norm();
            let wanted_m = 0.05 * (ahead_s - wanted_s);
            assert!(
                (missing_m - wanted_m).abs() < 5e-6,
                "{law:?}: {missing_m} m"
            );
        }
    }

    #[test]
    fn of_a_tool_that_rests_nothing_is_foreseen() {
        let way = |t_s: f64| Vec3::new(0.05 * t_s.min(0.3), 0.0, 0.0);
        let moving = after(Law::Straight, 300, way).0;
        let at_rest = after(Law::Straight, 300 + LAG_TICKS + 30, way).0;
        assert!(moving.is_some() && at_rest.is_none());
    }

    #[test]
    fn who_was_wrong_lately_foresees_less() {
        let turning = |t_s: f64| Vec3::new((8.0 * t_s).cos(), (8.0 * t_s).sin(), 0.0) * 0.01;
        let length_m = |law| {
            let (end, _) = after(law, 600, turning);
            let from = turning((600.0 - f64::from(LAG_TICKS)) * TICK_S);
            (end.unwrap() - from).norm()
        };
        assert!(length_m(Law::Trusted) < 0.9 * length_m(Law::Straight));
    }
}
