//! The scenarios of the live tests on virtual time, for machines that have no time for them.

use std::time::Duration;

use teleclay_clay::{Clay, Shape};
use teleclay_link::conditioner::Impairment;
use teleclay_operator::{Intent, Reach};
use teleclay_proto::frame::CopyState;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::rig::{Halt, Rig, Setup};
use teleclay_tests::recording::norm;
use teleclay_tests::relay::Line;

use super::endings::FORCE_STEP_N;

const RADIUS_M: f64 = 0.0064;

/// What a run is watched for, tick by tick.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    force_n: [f64; 3],
    greatest_step_n: f64,
    greatest_n: f64,
    stale: u32,
}

/// A ball that cuts a block, under a scheme.
struct Bench {
    rig: Rig,
    seen: Seen,
}

impl Bench {
    fn cutting(scheme: Scheme) -> Self {
        let reach = Reach {
            x_m: 0.045,
            y_m: 0.018,
            depth_m: 0.020,
        };
        let rig = Rig::new(Setup {
            parameters: LoopParameters {
                scheme,
                home_m: [0.064, 0.032, 0.064 + RADIUS_M],
                tool: ToolDescription::Ball { radius_m: RADIUS_M },
                ..LoopParameters::default()
            },
            clay: Clay::new(
                &Shape::Block {
                    size_m: [0.128, 0.064, 0.064],
                },
                1e-3,
            )
            .unwrap(),
            intent: Intent::cutting(reach).unwrap(),
            lines: Lines::default(),
        })
        .unwrap();
        let mut bench = Self {
            rig,
            seen: Seen::default(),
        };
        bench.run(1500);
        assert!(0 < bench.rig.session().clay().removed_units(), "no cut");
        bench
    }

    fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.rig.tick();
            let force_n = self.rig.last().felt_force_n;
            let before_n = self.seen.force_n;
            let step_n = norm(std::array::from_fn(|axis| force_n[axis] - before_n[axis]));
            let is_stale = self
                .rig
                .clay_copy()
                .is_some_and(|copy| copy.state() == CopyState::Stale);
            self.seen = Seen {
                force_n,
                greatest_step_n: self.seen.greatest_step_n.max(step_n),
                greatest_n: self.seen.greatest_n.max(norm(force_n)),
                stale: self.seen.stale + u32::from(is_stale),
            };
        }
    }

    fn impair(&mut self, up: Impairment, down: Impairment) {
        self.rig.impair(Lines {
            up,
            up_seed: 1,
            down,
            down_seed: 2,
        });
    }

    /// The hand rests until nothing is under way: the server's clay is then the hand's.
    fn assert_nothing_was_lost(mut self) {
        self.impair(Impairment::default(), Impairment::default());
        self.rig.hold_handles_fast();
        self.run(2000);
        let copy = self.rig.clay_copy().and_then(|copy| copy.copy()).unwrap();
        let (copied, held) = (copy.clay().clone(), self.rig.session().clay().clone());
        assert_eq!(copied.remaining_units(), held.remaining_units());
        let (mut copied, mut held) = (copied, held);
        assert_eq!(copied.hash(), held.hash());
        self.assert_is_gentle();
    }

    fn assert_is_gentle(&self) {
        println!("{:?}", self.seen);
        assert!(0.1 < self.seen.greatest_n, "hardly any force");
        assert!(self.seen.greatest_step_n <= FORCE_STEP_N);
    }
}

/// A line that does what the relay's does, as it is written down for the relay.
fn line(words: &str) -> Impairment {
    words.parse::<Line>().unwrap().0
}

fn cut_line() -> Impairment {
    Impairment {
        loss: 1.0,
        ..Impairment::default()
    }
}

/// Eight seconds of cutting over a bad line, and no cut of it lost.
pub(super) fn nothing_is_lost_over(up: &str, down: &str, ticks: u32) {
    let mut bench = Bench::cutting(Scheme::Replica);
    bench.impair(line(up), line(down));
    bench.run(ticks);
    assert_eq!(bench.seen.stale, 0, "the line kept up with what was cut");
    bench.assert_nothing_was_lost();
}

/// Five seconds without a line: felt from the copy, cut for two of them, and nothing lost.
pub(super) fn an_outage_of_five_seconds() {
    let mut bench = Bench::cutting(Scheme::Replica);
    bench.impair(line("delay_ms=20"), line("delay_ms=20"));
    bench.run(1000);
    bench.impair(cut_line(), cut_line());
    bench.run(5000);
    assert!(2000 < bench.seen.stale, "{} stale ticks", bench.seen.stale);
    bench.impair(line("delay_ms=20"), line("delay_ms=20"));
    bench.run(1000);
    bench.assert_nothing_was_lost();
}

/// The server's program is stopped for three seconds, and continued.
pub(super) fn a_server_that_stands_still() {
    let mut bench = Bench::cutting(Scheme::Replica);
    bench
        .rig
        .halt_session(Halt::Program, Duration::from_secs(3));
    bench.run(4500);
    assert!(500 < bench.seen.stale, "{} stale ticks", bench.seen.stale);
    bench.assert_nothing_was_lost();
}

/// Without a copy a cut line means no force, and a mended one brings it back gently.
pub(super) fn a_cut_line_releases_the_hand(scheme: Scheme) {
    let mut bench = Bench::cutting(scheme);
    bench.impair(cut_line(), cut_line());
    bench.run(200);
    let alone = bench.rig.session().clay().remaining_units();
    for _ in 0..500 {
        bench.run(1);
        assert_eq!(
            bench.seen.force_n, [0.0; 3],
            "{scheme}: force in the silence"
        );
    }
    assert_eq!(bench.rig.session().clay().remaining_units(), alone);
    bench.impair(Impairment::default(), Impairment::default());
    bench.run(3000);
    assert!(bench.rig.session().clay().remaining_units() < alone);
    bench.assert_is_gentle();
}

/// An uneven line, on which a passive scheme gives no energy.
pub(super) fn no_energy_is_made(scheme: Scheme, up: &str, down: &str) {
    let mut bench = Bench::cutting(scheme);
    bench.impair(line(up), line(down));
    bench.run(6000);
    let least_j = bench.rig.least_energy_j();
    assert!(-1e-6 <= least_j, "{scheme}: {least_j} J");
    bench.assert_is_gentle();
}

/// Either program is stopped for two seconds and continued: the force comes back without a step, and while a server
/// stands still there is none. How much of a queue is driven or felt is measured by the backlog tests of the rig, on a
/// hand that rests; this one moves on meanwhile, and under position-force the tool hurries after it.
pub(super) fn a_program_that_stands_still(scheme: Scheme) {
    for is_server in [true, false] {
        let mut bench = Bench::cutting(scheme);
        let span = Duration::from_secs(2);
        if is_server {
            bench.rig.halt_session(Halt::Program, span);
            bench.run(1000);
            assert_eq!(
                bench.seen.force_n, [0.0; 3],
                "{scheme}: force in the silence"
            );
        } else {
            bench.rig.halt_handle(Halt::Program, span);
        }
        bench.run(3000);
        bench.assert_is_gentle();
    }
}

/// Eight sessions with a hand each, that cut for two seconds and step no force.
pub(super) fn eight_sessions_cut() {
    for _ in 0..8 {
        let mut bench = Bench::cutting(Scheme::ForceExchange);
        bench.run(2000);
        bench.assert_is_gentle();
    }
}

/// They have to hold on any day, not only on one when a live test was starved.
mod always {
    use super::*;

    #[test]
    fn what_a_starved_test_falls_back_to_holds() {
        let bad = "jitter_ms=8 loss=0.1 duplicate=0.05 reorder=0.05";
        nothing_is_lost_over(
            &format!("delay_ms=40 {bad}"),
            &format!("delay_ms=60 {bad}"),
            4000,
        );
        an_outage_of_five_seconds();
        a_server_that_stands_still();
        eight_sessions_cut();
        for scheme in [Scheme::ForceExchange, Scheme::Wave, Scheme::Tdpa] {
            a_cut_line_releases_the_hand(scheme);
        }
        for scheme in [
            Scheme::ForceExchange,
            Scheme::PositionForce,
            Scheme::Wave,
            Scheme::Tdpa,
        ] {
            a_program_that_stands_still(scheme);
        }
        for scheme in [Scheme::Wave, Scheme::Tdpa] {
            no_energy_is_made(
                scheme,
                &format!("delay_ms=15 {bad}"),
                &format!("delay_ms=45 {bad}"),
            );
        }
    }
}
