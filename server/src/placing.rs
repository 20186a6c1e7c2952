//! On which thread a session lives, and whether there is time for it: pure functions of what sessions cost.
//!
//! **The bound.** A tick is late when what was to be done before it took longer than a period. So the costs of a
//! thread's sessions, each the 99th percentile of what its ticks took of the processor, may add up to a share of the
//! period ([`Budget`], three fifths unless told otherwise). The rest is for what no session's cost shows: the thread
//! wakes a tenth of a millisecond late, now and then orders are carried out, and some ticks take longer than 99 of a
//! hundred do. Percentiles do not add up, but their sum is above that of the sum where sessions do not all take long in
//! the same tick.
//!
//! **Placing.** A session that comes, or that somebody joins, goes to the thread with the least load, among equals to
//! the one with the fewest sessions; it stays where it is as long as there is time.
//!
//! **Rebalancing.** At most one session moves at a time, from the thread with the most load to the one with the least,
//! while these are [`HYSTERESIS`] apart: of all that may, the one that brings them nearest. A session may that is worth
//! it ([`LEAST_GAIN`]), and that does not turn the two around; or does, but brings them nearer by the hysteresis. So a
//! session that has moved goes back only after the costs have changed by as much, and with costs that stand still each
//! move lowers the sum of the squares of all loads: it comes to an end.

use std::time::Duration;

/// How far two threads are apart, in parts of a tick, for a session to move: a twentieth, above what costs waver by.
const HYSTERESIS: f64 = 0.05;
/// What a move has to bring two threads nearer, in parts of a tick.
const LEAST_GAIN: f64 = 0.005;
/// Ticks of a thread that started more than a whole tick late, in parts of all: with more of them nobody else is to
/// join who would make it worse.
const MOST_LATE: f64 = 0.05;

/// What a session costs where it lives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cost {
    pub(crate) session: u32,
    pub(crate) thread: usize,
    /// What its ticks take, s.
    pub(crate) work_s: f64,
}

/// A session is to live on another thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Relocation {
    pub(crate) session: u32,
    pub(crate) to: usize,
}

/// There is no time for what was asked.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoTickTime {
    /// The sessions take what there is.
    #[error(
        "it would take {:.0} µs of each tick, and the thread with the most time has {:.0} of its {:.0} µs free",
        wanted_s * 1e6, free_s * 1e6, budget_s * 1e6
    )]
    Taken {
        /// What it would take, s.
        wanted_s: f64,
        /// What is free where most is, s.
        free_s: f64,
        /// What sessions may take of a thread's tick, s.
        budget_s: f64,
    },
    /// The machine gives the thread less than it needs as it is.
    #[error(
        "{:.0} % of the last ticks started more than a whole tick late, {:.0} % may: the machine has no time for more",
        late_share * 100.0, most_share * 100.0
    )]
    Late {
        /// Late ticks of the thread with the fewest, in parts of all.
        late_share: f64,
        /// What there may be.
        most_share: f64,
    },
}

/// What sessions may take of a thread's tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Budget {
    tick: Duration,
    /// In parts of the tick; nobody is refused without.
    share: Option<f64>,
}

/// A share of the tick that there cannot be.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("tick_budget is {got}, want 0 to 1; with 0 nobody is refused")]
pub(crate) struct BudgetError {
    got: f64,
}

impl Budget {
    /// Sessions may take `share` of each tick; with 0 they may take what they like.
    ///
    /// # Errors
    /// It is no share.
    pub(crate) fn new(tick: Duration, share: f64) -> Result<Self, BudgetError> {
        if !(0.0..=1.0).contains(&share) {
            return Err(BudgetError { got: share });
        }
        let share = (0.0 < share).then_some(share);
        Ok(Self { tick, share })
    }

    /// What sessions may take of a thread's tick, s; without a bound all of it.
    pub(crate) fn per_tick_s(&self) -> f64 {
        self.tick.as_secs_f64() * self.share.unwrap_or(1.0)
    }

    /// Where a session goes that will cost `wanted_s`, whether or not there is time.
    pub(crate) fn place(&self, threads: usize, costs: &[Cost]) -> usize {
        let load = |thread: usize| load_s(thread, costs);
        let sessions = |thread| costs.iter().filter(|cost| cost.thread == thread).count();
        (0..threads)
            .min_by(|&a, &b| {
                let by_load = load(a).total_cmp(&load(b));
                by_load.then(sessions(a).cmp(&sessions(b)))
            })
            .unwrap_or(0)
    }

    /// Where `session` may take `more_s` more than now: on its own thread, if there is time, else on the one with the
    /// least load. `late_shares` are the late ticks of each thread, in parts of all; they count where others than the
    /// session would be made late.
    ///
    /// # Errors
    /// Nowhere.
    pub(crate) fn admit(
        &self,
        costs: &[Cost],
        late_shares: &[f64],
        session: u32,
        more_s: f64,
    ) -> Result<usize, NoTickTime> {
        let own = costs.iter().find(|cost| cost.session == session);
        let others: Vec<Cost> = costs
            .iter()
            .filter(|cost| cost.session != session)
            .copied()
            .collect();
        let least = self.place(late_shares.len(), &others);
        let own_thread = own.map_or(least, |own| own.thread);
        if self.share.is_none() {
            return Ok(own_thread);
        }
        let wanted_s = more_s + own.map_or(0.0, |own| own.work_s);
        let budget_s = self.per_tick_s();
        let late = |thread: usize| late_shares.get(thread).copied().unwrap_or(0.0);
        let mut refusal = None;
        for thread in [own_thread, least] {
            let load_s = load_s(thread, &others);
            let is_shared = 0.0 < load_s;
            if is_shared && budget_s < load_s + wanted_s {
                refusal = Some(NoTickTime::Taken {
                    wanted_s,
                    free_s: (budget_s - load_s).max(0.0),
                    budget_s,
                });
            } else if is_shared && MOST_LATE < late(thread) {
                refusal = Some(NoTickTime::Late {
                    late_share: late(thread),
                    most_share: MOST_LATE,
                });
            } else {
                return Ok(thread);
            }
        }
        refusal.map_or(Ok(own_thread), Err)
    }

    /// The session that should live elsewhere, if one should.
    pub(crate) fn rebalance(&self, threads: usize, costs: &[Cost]) -> Option<Relocation> {
        let by_load = |a: &usize, b: &usize| load_s(*a, costs).total_cmp(&load_s(*b, costs));
        let from = (0..threads).max_by(by_load)?;
        let to = (0..threads).min_by(by_load)?;
        let apart_s = load_s(from, costs) - load_s(to, costs);
        let tick_s = self.tick.as_secs_f64();
        if apart_s < HYSTERESIS * tick_s {
            return None;
        }
        let apart_after = |cost: &Cost| (apart_s - 2.0 * cost.work_s).abs();
        let helps = |cost: &&Cost| {
            let turns_around = apart_s < 2.0 * cost.work_s;
            let least_gain = if turns_around { HYSTERESIS } else { LEAST_GAIN };
            cost.thread == from && apart_after(cost) + least_gain * tick_s <= apart_s
        };
        let best = costs
            .iter()
            .filter(helps)
            .min_by(|a, b| apart_after(a).total_cmp(&apart_after(b)))?;
        Some(Relocation {
            session: best.session,
            to,
        })
    }
}

/// What the sessions of a thread take of a tick together, s.
pub(crate) fn load_s(thread: usize, costs: &[Cost]) -> f64 {
    let own = costs.iter().filter(|cost| cost.thread == thread);
    own.map(|cost| cost.work_s).sum()
}

/// How many threads there are where nobody has said: one on a machine of one or two processors, else one for every two,
/// since the network takes as much as the ticks; `most` at most.
pub(crate) fn threads_by_rule(processors: usize, most: usize) -> usize {
    (processors / 2).clamp(1, most)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TICK: Duration = Duration::from_millis(1);

    fn budget(share: f64) -> Budget {
        Budget::new(TICK, share).unwrap()
    }

    /// Sessions numbered from 0, each on the thread and with the cost in µs that is given.
    fn costs(of: &[(usize, f64)]) -> Vec<Cost> {
        (0..)
            .zip(of)
            .map(|(session, &(thread, us))| Cost {
                session,
                thread,
                work_s: us * 1e-6,
            })
            .collect()
    }

    fn apart_s(threads: usize, costs: &[Cost]) -> f64 {
        let loads = (0..threads).map(|thread| load_s(thread, costs));
        let (least, most) = loads.fold((f64::MAX, 0.0_f64), |(least, most), load| {
            (least.min(load), most.max(load))
        });
        most - least
    }

    #[test]
    fn one_thread_on_two_processors_and_half_as_many_beyond() {
        let threads = [1, 2, 3, 4, 5, 8, 16, 64].map(|cores| threads_by_rule(cores, 8));
        assert_eq!(threads, [1, 1, 1, 2, 2, 4, 8, 8]);
    }

    #[test]
    fn a_session_goes_where_the_least_is_done_and_among_idle_ones_where_the_fewest_are() {
        let budget = budget(0.6);
        assert_eq!(
            budget.place(3, &costs(&[(0, 80.0), (1, 20.0), (2, 40.0)])),
            1
        );
        assert_eq!(budget.place(2, &costs(&[(0, 0.0), (0, 0.0), (1, 0.0)])), 1);
        assert_eq!(budget.place(2, &[]), 0);
    }

    #[test]
    fn who_fits_stays_who_does_not_moves_and_who_fits_nowhere_is_told_the_figures() {
        let budget = budget(0.6);
        let on_time = [0.0, 0.0];
        let full = costs(&[(0, 550.0), (0, 0.0), (1, 100.0), (1, 450.0)]);
        assert_eq!(budget.admit(&full, &on_time, 1, 50e-6), Ok(0));
        let refused = budget.admit(&full, &on_time, 1, 51e-6).unwrap_err();
        let said = refused.to_string();
        assert!(
            said.contains("51 µs") && said.contains("50 of its 600 µs"),
            "{said}"
        );
        let room_elsewhere = costs(&[(0, 550.0), (0, 0.0), (1, 100.0)]);
        assert_eq!(budget.admit(&room_elsewhere, &on_time, 1, 51e-6), Ok(1));
        // One that nobody is beside makes nobody late.
        let alone = costs(&[(0, 900.0)]);
        assert_eq!(budget.admit(&alone, &[0.9, 0.9], 0, 300e-6), Ok(0));
    }

    /// What it takes already counts for it where it goes, and not against it where it is.
    #[test]
    fn what_a_session_takes_already_is_counted_once() {
        let budget = budget(0.6);
        let costs = costs(&[(0, 300.0), (0, 200.0), (1, 350.0)]);
        assert_eq!(budget.admit(&costs, &[0.0; 2], 1, 100e-6), Ok(0));
        // 300 + 301 is too much here, 350 + 301 there.
        assert!(budget.admit(&costs, &[0.0; 2], 1, 101e-6).is_err());
    }

    #[test]
    fn where_ticks_start_late_nobody_joins_beside_others() {
        let budget = budget(0.6);
        let two = costs(&[(0, 20.0), (0, 0.0)]);
        assert_eq!(budget.admit(&two, &[0.05], 1, 25e-6), Ok(0));
        let said = budget.admit(&two, &[0.06], 1, 25e-6).unwrap_err();
        assert!(matches!(said, NoTickTime::Late { .. }), "{said}");
        // The other thread is in time.
        assert_eq!(budget.admit(&two, &[0.06, 0.0], 1, 25e-6), Ok(1));
        let unbound = Budget::new(TICK, 0.0).unwrap();
        assert_eq!(unbound.admit(&two, &[1.0], 1, 1.0), Ok(0));
    }

    #[test]
    fn a_share_is_one() {
        for share in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
            assert!(Budget::new(TICK, share).is_err(), "{share}");
        }
    }

    #[test]
    fn a_move_that_helps_little_is_none() {
        let budget = budget(0.6);
        assert_eq!(budget.rebalance(2, &costs(&[(0, 30.0), (0, 19.0)])), None);
        assert_eq!(budget.rebalance(2, &costs(&[(0, 60.0), (0, 2.0)])), None);
        // Eight that cost little are a load together.
        assert!(budget.rebalance(2, &costs(&[(0, 20.0); 8])).is_some());
        let moved = budget.rebalance(2, &costs(&[(0, 30.0), (0, 26.0), (0, 30.0)]));
        assert_eq!(moved.map(|moved| moved.to), Some(1));
        // A session that takes everything helps nowhere else.
        assert_eq!(budget.rebalance(2, &costs(&[(0, 900.0), (1, 0.0)])), None);
        assert_eq!(budget.rebalance(1, &costs(&[(0, 900.0), (0, 900.0)])), None);
    }

    proptest! {
        /// With costs that stand still it comes to an end, nobody goes back at once, and in the end the threads are no
        /// further apart than what their largest session explains.
        #[test]
        fn rebalancing_comes_to_an_end(
            threads in 1..6_usize,
            sessions in prop::collection::vec((0..6_usize, 0.0..300.0), 0..32),
        ) {
            let budget = budget(0.6);
            let sessions: Vec<_> = sessions.iter().map(|&(at, us)| (at % threads, us)).collect();
            let mut costs = costs(&sessions);
            let mut moves = 0;
            while let Some(Relocation { session, to }) = budget.rebalance(threads, &costs) {
                let squares = |costs: &[Cost]| -> f64 {
                    (0..threads).map(|thread| load_s(thread, costs).powi(2)).sum()
                };
                let before = (squares(&costs), costs.clone());
                costs[session as usize].thread = to;
                prop_assert!(squares(&costs) < before.0);
                let back = budget.rebalance(threads, &costs);
                let from = before.1[session as usize].thread;
                prop_assert_ne!(back, Some(Relocation { session, to: from }));
                moves += 1;
                prop_assert!(moves <= 200, "{} sessions", costs.len());
            }
            let largest_s = costs.iter().map(|cost| cost.work_s).fold(0.0, f64::max);
            let most_s = (largest_s + 0.025e-3).max(0.05e-3).max(32.0 * 0.0025e-3);
            prop_assert!(apart_s(threads, &costs) <= most_s + 1e-12);
        }

        /// Costs that waver by less than a quarter of the hysteresis move nobody who has come to rest for long: over a
        /// thousand looks there are no more moves than there are sessions.
        #[test]
        fn costs_that_waver_move_nobody_for_ever(
            sessions in prop::collection::vec((0..2_usize, 20.0..200.0), 1..12),
            noise in prop::collection::vec(-1.0..1.0, 1000),
        ) {
            let budget = budget(0.6);
            let mut still = costs(&sessions);
            let wavers_s = 0.25 * HYSTERESIS * TICK.as_secs_f64() / sessions.len() as f64;
            let mut moves = 0;
            for look in 0..1000 {
                let mut seen = still.clone();
                for (number, cost) in seen.iter_mut().enumerate() {
                    cost.work_s += noise[(look + 7 * number) % 1000] * wavers_s;
                }
                if let Some(Relocation { session, to }) = budget.rebalance(2, &seen) {
                    still[session as usize].thread = to;
                    moves += 1;
                }
            }
            prop_assert!(moves <= sessions.len(), "{moves} moves");
        }

        /// Whoever is let in beside others leaves the thread within its bound.
        #[test]
        fn who_is_let_in_fits(
            sessions in prop::collection::vec((0..3_usize, 0.0..200.0), 1..12),
            share in 0.1..1.0,
            more_us in 0.0..400.0,
        ) {
            let budget = budget(share);
            let costs = costs(&sessions);
            if let Ok(thread) = budget.admit(&costs, &[0.0; 3], 0, more_us * 1e-6) {
                let others = load_s(thread, &costs[1..]);
                let own = costs[0].work_s + more_us * 1e-6;
                prop_assert!(others == 0.0 || others + own <= budget.per_tick_s() + 1e-12);
            }
        }
    }
}
