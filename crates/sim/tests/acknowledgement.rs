//! Cuts over lines that drop whatever was overtaken, between programs that are starved now and then: each is
//! acknowledged within a few round trips, and the clay becomes one. `crates/link/tests/acknowledgement.rs` asks the
//! same of a thousand lines.

mod rigs;

use std::collections::BTreeSet;
use std::time::Duration;

use rigs::{TICK, both_ways, carving, cutting, line, running};
use teleclay_bilateral::{HandleSide, Lease};
use teleclay_clay::{Clay, Shape};
use teleclay_device::DeviceSample;
use teleclay_link::conditioner::{Impairment, Overtaken};
use teleclay_link::scheme::replica::Snapshot;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{CopyState, Gap, ToolFrame};
use teleclay_proto::{Material, Scheme};
use teleclay_sim::rig::{Halt, Rig};

/// What is left when a transport drops what was overtaken, over a network that jitters.
fn overtaking(delay_ms: u32, jitter_ratio: f64) -> Impairment {
    Impairment {
        duplicate: 0.05,
        overtaken: Overtaken::Dropped,
        ..line(delay_ms, jitter_ratio, 0.1)
    }
}

/// How old the oldest cut is that has not been acknowledged, tick by tick, from when each was made.
#[derive(Default)]
struct Ages {
    /// Tick in which each sweep was made, by its number less one.
    made: Vec<u64>,
    tick: u64,
    oldest: u64,
}

impl Ages {
    fn look(&mut self, rig: &Rig) {
        self.tick += 1;
        let log = rig.clay_copy().expect("a replica").log();
        self.made.resize(log.last() as usize, self.tick);
        if let Some(made) = self.made.get(log.acknowledged() as usize) {
            self.oldest = self.oldest.max(self.tick - made);
        }
    }
}

/// The jitters are those of the live test that found an acknowledgement standing still (a fifth of the delay), and
/// worse ones.
#[test]
fn behind_starved_programs_no_cut_waits_for_long_and_the_clay_becomes_one() {
    const SERVER_STARVED_MS: u32 = 250;
    const HANDLE_STARVED_MS: u32 = 80;
    for seed in 0..12_u64 {
        let (delay_ms, jitter_ratio) =
            [(50, 0.2), (10, 0.5), (100, 0.5), (250, 0.3)][seed as usize % 4];
        let mut rig = carving(
            running(Scheme::Replica),
            cutting(),
            Material::default(),
            both_ways(overtaking(delay_ms, jitter_ratio), seed),
        );
        let (mut ages, mut stale) = (Ages::default(), 0);
        for tick in 0..12_000_u64 {
            if tick % 1500 == 700 + 40 * seed {
                rig.halt_session(Halt::Thread, TICK * SERVER_STARVED_MS);
            }
            if tick % 1700 == 900 {
                rig.halt_handle(Halt::Thread, TICK * HANDLE_STARVED_MS);
            }
            rig.tick();
            ages.look(&rig);
            stale += u64::from(rig.clay_copy().expect("a replica").state() == CopyState::Stale);
        }
        let case = format!("{delay_ms} ms each way, jitter {jitter_ratio}, seed {seed}");
        println!("{case}: the oldest cut was {} ms old", ages.oldest);
        let bound_ms = 8 * delay_ms + 100 + SERVER_STARVED_MS + HANDLE_STARVED_MS;
        assert!(
            ages.oldest <= u64::from(bound_ms),
            "{case}: {} ms",
            ages.oldest
        );
        assert_eq!(stale, 0, "{case}");
        assert!(3000 < ages.made.len(), "{case}: hardly cut");

        rig.hold_handles_fast();
        rig.run_for(Duration::from_secs(3));
        let replica = rig.clay_copy().expect("a replica");
        assert_eq!(replica.log().waiting(), 0, "{case}");
        let copy = replica.copy().expect("it came with the lease");
        let here = copy.clay().clone().hash();
        assert_eq!(here, rig.session().clay().clone().hash(), "{case}");
        assert_eq!(rig.tool().view().sweeps_refused, 0, "{case}");
    }
}

/// What has come to a server that ran the session before has not come to the one that runs it now.
#[test]
fn another_server_is_sent_what_the_one_before_had() {
    let lease = Lease {
        number: 7,
        ownership_epoch: 1,
    };
    let mut handle = HandleSide::new(&running(Scheme::Replica), lease).unwrap();
    let shape = Shape::Block { size_m: [0.02; 3] };
    handle.handle_snapshot(Snapshot {
        clay: Box::new(Clay::new(&shape, 1e-3).unwrap()),
        epoch: 1,
    });
    let at = |ms: u32| Timestamp::ZERO.after(TICK * ms);
    let mut tool = ToolFrame::default();
    tool.header.lease = 7;
    tool.header.clay_epoch = 1;
    let mut hear = |handle: &mut HandleSide, ms: u32, owner: u32| {
        tool.header.sequence += 1;
        tool.header.sent_ns = at(ms).as_nanos();
        tool.header.ownership_epoch = owner;
        tool.sweep_gaps.clear();
        if owner == 1 && 1000 < ms {
            let gap = Gap {
                missing: 1,
                come: 200,
            };
            tool.sweep_gaps.push(gap).unwrap();
        }
        handle.handle_frame(at(ms), &tool);
    };
    let mut sent = Vec::new();
    for ms in 1..3000 {
        let sample = DeviceSample {
            position_m: [1e-5 * f64::from(ms.min(300)), 0.0, 0.0],
            velocity_m_s: [0.0; 3],
            hand_force_n: [0.0; 3],
        };
        // The first server has all but the first sweep from a second on; another takes over after two.
        if ms % 1000 == 1 {
            hear(&mut handle, ms, 1 + ms / 2000);
        }
        handle.step(at(ms), &sample);
        let sweeps = handle.frame().sweeps.iter();
        sent.push(sweeps.map(|sweep| sweep.sequence).collect::<Vec<_>>());
    }
    let had = 2..=201;
    let of_those_had = |span: std::ops::Range<usize>| {
        let sweeps: BTreeSet<u32> = sent[span].iter().flatten().copied().collect();
        assert!(sweeps.contains(&1) && sweeps.contains(&202));
        sweeps.range(had.clone()).count()
    };
    assert_eq!(of_those_had(0..1000), 200);
    assert_eq!(of_those_had(1000..2000), 0);
    assert_eq!(of_those_had(2000..2999), 200);
}
