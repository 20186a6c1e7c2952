//! One run, and what it shows when it is held against the run without a network.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use teleclay_latency::cell::{Cell, Profile};
use teleclay_latency::table::Quantiles;
use teleclay_proto::Scheme;
use teleclay_sim::rig::Rig;

use crate::forecast::Law;
use crate::foreseeing::Foreseeing;
use crate::motions::{self, Motion};

/// As in the table: the just noticeable difference of a force, and what no difference below is noticed.
const JND: f64 = 0.07;
const JND_FLOOR_N: f64 = 0.02;
const TICK_S: f64 = 1e-3;

/// What both hands felt, tick by tick, N.
pub(crate) type Felt = Vec<[[f64; 2]; 2]>;

/// What one run showed, both hands together.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outcome {
    /// Force error over force, root mean squares.
    pub(crate) force_nrmse: f64,
    /// Share of time in which the force is off by more than a hand can tell.
    pub(crate) share_above_jnd: f64,
    /// Felt force less the authority's answer, over the felt force.
    pub(crate) hidden_nrmse: f64,
    /// How far corrections moved the felt forces, N.
    pub(crate) moved_n: f64,
    /// Steps by corrections, N.
    pub(crate) steps_n: Vec<f64>,
    /// Energy that corrections brought into the hands, J.
    pub(crate) injected_j: f64,
    /// Least energy of the first hand's channel to its copy, J.
    pub(crate) least_energy_j: f64,
    /// Work that the authority's clay took and the hands did not feel, J: they moved on as if less clay stood there.
    pub(crate) spared_j: f64,
    /// Clay that came back because a forecast was changed, over what was removed.
    pub(crate) given_back: f64,
    /// Clay that was foreseen to go and never went, over what was removed.
    pub(crate) never_cut: f64,
}

/// The truth: the replica without a network.
pub(crate) fn reference(motion: Motion, seed: u64) -> Felt {
    let cell = Cell {
        scheme: Scheme::Replica.into(),
        delay_ms: 0,
        jitter_ratio: 0.0,
        loss: 0.0,
        profile: Profile::SecondWriter,
    };
    let mut rig = motions::rig(motion, &cell, seed, Arc::new(Scheme::Replica)).expect(SOUND);
    let mut felt = Felt::new();
    motions::work(&mut rig, motion, seed, |rig| felt.push(forces(rig)));
    felt
}

const SOUND: &str = "the rig's constants are sound";

/// A run with a law.
pub(crate) fn run(motion: Motion, cell: &Cell, law: Law, seed: u64, truth: &Felt) -> Outcome {
    // The task's second operator comes with its profile.
    let controllers = Arc::new(Foreseeing::new(law));
    let mut rig = motions::rig(motion, cell, seed, Arc::clone(&controllers) as _).expect(SOUND);
    let (mut error_n2, mut truth_n2, mut noticed) = (0.0, 0.0, 0_u64);
    let (mut hidden_n2, mut felt_n2, mut spared_j) = (0.0, 0.0, 0.0);
    let mut tick = 0;
    motions::work(&mut rig, motion, seed, |rig| {
        for (slot, (felt, ideal)) in forces(rig).into_iter().zip(truth[tick]).enumerate() {
            let error_n = (felt[0] - ideal[0]).hypot(felt[1] - ideal[1]);
            let ideal_n = ideal[0].hypot(ideal[1]);
            error_n2 += error_n * error_n;
            truth_n2 += ideal_n * ideal_n;
            noticed += u64::from((JND * ideal_n).max(JND_FLOOR_N) < error_n);
            let side = rig.session().side(slot).expect(SOUND);
            let view = side.view();
            let ([hx, hy, _], [vx, vy, _]) = (view.hidden_force_n, view.velocity_m_s);
            spared_j += (hx * vx + hy * vy).max(0.0) * TICK_S;
            hidden_n2 += hx * hx + hy * hy;
            felt_n2 += felt[0] * felt[0] + felt[1] * felt[1];
        }
        tick += 1;
    });
    rig.hold_handles_fast();
    // A round trip, with what jitter adds to it.
    rig.run_for(Duration::from_millis(u64::from(3 * cell.delay_ms) + 200));
    let least_energy_j = rig.least_energy_j();
    let told = controllers.told();
    let truth_clay = rig.session().clay();
    let removed = truth_clay.removed_units() as f64;
    let never_cut: u64 = told
        .iter()
        .filter_map(|told| told.foreseen.as_ref())
        .map(|foreseen| crate::foreseeing::more_units(foreseen, truth_clay))
        .sum();
    Outcome {
        force_nrmse: (error_n2 / truth_n2).sqrt(),
        share_above_jnd: noticed as f64 / (2 * tick) as f64,
        hidden_nrmse: (hidden_n2 / felt_n2).sqrt(),
        moved_n: told.iter().map(|told| told.moved_n).sum(),
        injected_j: told.iter().map(|told| told.injected_j).sum(),
        least_energy_j,
        spared_j,
        given_back: told
            .iter()
            .map(|told| told.given_back_units as f64)
            .sum::<f64>()
            / removed,
        never_cut: never_cut as f64 / removed,
        steps_n: told.into_iter().flat_map(|told| told.steps_n).collect(),
    }
}

fn forces(rig: &Rig) -> [[f64; 2]; 2] {
    [0, 1].map(|slot| {
        let [x, y, _] = rig.handle_of(slot).frame().felt_force_n;
        [x, y]
    })
}

/// Outcomes of many seeds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sum {
    outcomes: Vec<Outcome>,
}

impl Sum {
    /// What its figures are, in their order.
    pub(crate) const HEADINGS: &str = "force error, % | above JND, % | hidden, % | moved, N | step p95, N | max, N | \
         injected, mJ | least energy, mJ | spared, mJ | given back, % | never cut, %";

    /// One more.
    pub(crate) fn add(&mut self, outcome: Outcome) {
        self.outcomes.push(outcome);
    }

    fn mean(&self, value: fn(&Outcome) -> f64) -> f64 {
        self.outcomes.iter().map(value).sum::<f64>() / self.outcomes.len() as f64
    }
}

impl fmt::Display for Sum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let steps = self.outcomes.iter().flat_map(|outcome| &outcome.steps_n);
        let steps = Quantiles::of(steps.copied().collect());
        write!(
            f,
            "{:.2} | {:.1} | {:.1} | {:.1} | {:.3} | {:.3} | {:.3} | {:.2} | {:.2} | {:.1} | {:.2}",
            100.0 * self.mean(|outcome| outcome.force_nrmse),
            100.0 * self.mean(|outcome| outcome.share_above_jnd),
            100.0 * self.mean(|outcome| outcome.hidden_nrmse),
            self.mean(|outcome| outcome.moved_n),
            steps.p95,
            steps.max,
            1e3 * self.mean(|outcome| outcome.injected_j),
            1e3 * self.mean(|outcome| outcome.least_energy_j),
            1e3 * self.mean(|outcome| outcome.spared_j),
            100.0 * self.mean(|outcome| outcome.given_back),
            100.0 * self.mean(|outcome| outcome.never_cut),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use teleclay_link::scheme::ClayCopy;

    fn cell(delay_ms: u32) -> Cell {
        Cell {
            scheme: Scheme::Replica.into(),
            delay_ms,
            jitter_ratio: 0.2,
            loss: 0.0,
            profile: Profile::SecondWriter,
        }
    }

    /// Forces of both hands under a law, and the rig as it is when all has come to rest.
    fn felt(motion: Motion, law: Law) -> (Felt, Rig, Vec<crate::foreseeing::Told>) {
        let controllers = Arc::new(Foreseeing::new(law));
        let mut rig = motions::rig(motion, &cell(25), 7, Arc::clone(&controllers) as _).unwrap();
        let mut felt = Felt::new();
        motions::work(&mut rig, motion, 7, |rig| felt.push(forces(rig)));
        rig.hold_handles_fast();
        rig.run_for(Duration::from_secs(1));
        (felt, rig, controllers.told())
    }

    /// The second field and the second limiter are those of the replica: without a forecast they show it, but for what
    /// a cut beyond the copy's own bound of being near changes of the force of a tool that slants.
    #[test]
    fn without_a_forecast_the_hand_feels_the_replica() {
        const SLANT_N: f64 = 1e-3;
        for motion in [Motion::Pushes, Motion::Stops] {
            let mut rig = motions::rig(motion, &cell(25), 7, Arc::new(Scheme::Replica)).unwrap();
            let mut plain = Felt::new();
            motions::work(&mut rig, motion, 7, |rig| plain.push(forces(rig)));
            let (felt, layered, told) = felt(motion, Law::None);
            assert_eq!(plain.len(), felt.len());
            let pairs = plain.iter().flatten().zip(felt.iter().flatten());
            let off_n = pairs
                .map(|(plain, felt)| (plain[0] - felt[0]).hypot(plain[1] - felt[1]))
                .fold(0.0, f64::max);
            println!("{}: off by {off_n} N at most", motion.word());
            assert!(off_n < SLANT_N, "{}: {off_n} N", motion.word());
            for (slot, told) in told.iter().enumerate() {
                let copy = layered.handle_of(slot).clay_copy().and_then(ClayCopy::copy);
                let limiter = copy.unwrap().limiter();
                assert!(0.1 < limiter.moved_n(), "nothing was corrected");
                assert!((told.moved_n / limiter.moved_n() - 1.0).abs() < 0.01);
            }
        }
    }

    /// Forecasts were wrong, by more than the block's rounding: yet what is sent, merged and copied knows nothing of
    /// them, and once all has come the felt clay is the server's again.
    #[test]
    fn a_wrong_forecast_is_gone_when_the_truth_has_come() {
        for law in [Law::Straight, Law::Bent, Law::Bounded(0.07)] {
            let (_, rig, told) = felt(Motion::Tremor, law);
            let authority = rig.session().clay().clone().hash();
            for (slot, told) in told.iter().enumerate() {
                let case = format!("{} at {slot}", law.word());
                let copy = rig.handle_of(slot).clay_copy().and_then(ClayCopy::copy);
                assert_eq!(copy.unwrap().hash(), Some(authority), "{case}");
                assert_eq!(told.felt_hash, Some(authority), "{case}");
                let foreseen = told.foreseen.as_ref().unwrap();
                let wrong = crate::foreseeing::more_units(foreseen, rig.session().clay());
                assert!(1000 * 255 < wrong, "{case}: nothing was foreseen wrongly");
                assert!(0 < told.given_back_units, "{case}");
            }
        }
    }

    #[test]
    fn the_bounds_of_the_laws_hold() {
        let range_n = teleclay_proto::join::LoopParameters::default().force_limit_n;
        for (law, most_n) in [
            (Law::Straight, 0.02 * range_n),
            (Law::Bounded(0.07), 0.07 * range_n),
        ] {
            let (_, _, told) = felt(Motion::Stops, law);
            for told in &told {
                let step_n = told.steps_n.iter().copied().fold(0.0, f64::max);
                assert!(
                    0.0 < step_n && step_n <= most_n + 1e-9,
                    "{}: {step_n} N",
                    law.word()
                );
                assert!(told.injected_j <= told.earned_j);
            }
            let injected_j: f64 = told.iter().map(|told| told.injected_j).sum();
            assert_eq!(injected_j <= 0.0, law.is_at_once(), "{}", law.word());
        }
    }

    /// The measure of what a hand is spared finds what it should: with the replica as it is, a copy has more clay than
    /// the server if anything.
    #[test]
    fn a_forecast_spares_hands_work_that_the_clay_takes() {
        let truth = reference(Motion::Stops, 7);
        let [none, straight] =
            [Law::None, Law::Straight].map(|law| run(Motion::Stops, &cell(25), law, 7, &truth));
        assert!(
            5.0 * none.spared_j < straight.spared_j,
            "{} J and {} J",
            none.spared_j,
            straight.spared_j
        );
        assert!(straight.force_nrmse < 0.7 * none.force_nrmse);
        assert!(none.injected_j <= 0.0 && none.never_cut <= 0.0 && none.given_back <= 0.0);
    }
}
