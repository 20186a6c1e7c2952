//! Cuts over lines that drop whatever was overtaken, between programs that are starved now and then: each is acknowledged within a few round trips.

mod rigs;

use std::time::Duration;

use rigs::{TICK, both_ways, carving, cutting, running};
use teleclay_link::conditioner::{Impairment, Overtaken};
use teleclay_proto::frame::CopyState;
use teleclay_proto::{Material, Scheme};
use teleclay_sim::rig::{Halt, Rig};

/// What is left when a transport drops what was overtaken, over a network that jitters.
fn overtaking(delay_ms: u32, jitter_ratio: f64) -> Impairment {
    Impairment {
        loss: 0.1,
        duplicate: 0.05,
        reorder: 0.0,
        overtaken: Overtaken::Dropped,
        ..rigs::line(delay_ms, jitter_ratio, 0.1)
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

#[test]
fn behind_a_starved_server_no_cut_waits_for_long() {
    for seed in 0..12_u64 {
        let (delay_ms, jitter_ratio) = [(50, 0.2), (10, 0.5), (100, 0.5), (250, 0.3)][seed as usize % 4];
        let mut rig = carving(
            running(Scheme::Replica),
            cutting(),
            Material::default(),
            both_ways(overtaking(delay_ms, jitter_ratio), seed),
        );
        let mut ages = Ages::default();
        let mut stale = 0;
        for tick in 0..12_000_u64 {
            // Starved for a quarter of a second every second and a half, as by a compiler on the same cores.
            if tick % 1500 == 700 + 40 * seed {
                rig.halt_session(Halt::Thread, TICK * 250);
            }
            if tick % 1700 == 900 {
                rig.halt_handle(Halt::Thread, TICK * 80);
            }
            rig.tick();
            ages.look(&rig);
            stale += u64::from(rig.clay_copy().expect("a replica").state() == CopyState::Stale);
        }
        println!("{delay_ms} ms, {jitter_ratio}: oldest {} ms, {stale} ticks stale", ages.oldest);
    }
}
