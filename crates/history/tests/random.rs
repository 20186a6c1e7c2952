//! A thousand random histories: snapshot and records are the session, bit for bit, at every point that is tried.
//!
//! Commands, frames of every kind, silences, undo, redo and restarts under every scheme; records are read again from
//! the beginning, and from snapshots in between.

#[path = "../../session/tests/bench/mod.rs"]
mod bench;
mod world;

use teleclay_history::{Replay, ReplayError, State};
use world::{Counts, Live, World, assert_same};

const HISTORIES: u64 = 1000;

#[test]
#[allow(clippy::print_stdout, reason = "the counts are a result")]
fn a_thousand_histories_are_their_sessions_bit_for_bit_at_every_point_tried() {
    let parts: Vec<_> = (0..2_u64)
        .map(|part| std::thread::spawn(move || run(part)))
        .collect();
    let mut all = Counts::default();
    for part in parts {
        all.add(&part.join().unwrap());
    }
    println!("{HISTORIES} histories: {all:?}");
    assert!(10_000 < all.points && 5_000 < all.points_from_snapshots);
    assert!(500 < all.restarts && 300 < all.exchanges && 1_000 < all.fresh_blocks);
    assert!(200 < all.stops && 50 < all.grants && 1_000 < all.other_manners);
    assert!(50 < all.points_stopped && 300 < all.points_reserved);
    assert!(100 < all.earlier_bases && 10_000 < all.removing_ticks);
    assert!(100 < all.adding_ticks && 100 < all.smoothing_ticks);
}

fn run(part: u64) -> Counts {
    let mut all = Counts::default();
    for seed in (part * HISTORIES / 2)..((part + 1) * HISTORIES / 2) {
        let mut world = World::new(seed);
        for _ in 0..250 {
            world.step();
        }
        check(&mut world);
        all.add(&world.counts);
    }
    all
}

/// Reads all records again, and from some of the points on.
fn check(world: &mut World) {
    let Live {
        records, points, ..
    } = &world.live;
    let mut replay = Replay::begin(&records[0], Vec::new()).unwrap();
    let mut snapshots = Vec::new();
    let mut next = points.iter().peekable();
    for (index, record) in records.iter().enumerate() {
        if 0 < index {
            replay.apply(record).unwrap();
        }
        while let Some(point) = next.next_if(|point| point.records == index + 1) {
            let mut state = replay.state();
            assert_same(&mut state, point);
            world.counts.points += 1;
            if point.records % 7 == 0 {
                snapshots.push((index + 1, state.encode()));
            }
        }
    }
    for (from, bytes) in snapshots {
        let mut state = State::decode(&bytes).unwrap();
        assert_eq!(state.encode(), bytes);
        let mut replay = Replay::from_state(state, Vec::new());
        let mut next = points
            .iter()
            .skip_while(|point| point.records < from)
            .peekable();
        for (index, record) in records.iter().enumerate().skip(from) {
            match replay.apply(record) {
                Ok(()) => {}
                Err(ReplayError::EarlierBaseNeeded { .. }) => {
                    world.counts.earlier_bases += 1;
                    break;
                }
                Err(error) => panic!("{error}"),
            }
            while let Some(point) = next.next_if(|point| point.records <= index + 1) {
                if point.records == index + 1 {
                    assert_same(&mut replay.state(), point);
                    world.counts.points_from_snapshots += 1;
                }
            }
        }
    }
}
