//! What was recorded comes out again, bit for bit, and what was tampered with does not.

mod rigs;

use std::ops::Range;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use rand_core::Rng as _;
use rand_pcg::Pcg32;
use rigs::{File, Recorded, SCHEMES, about, command, counts, line, rewritten, rig_of_two};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_recording::{About, Diagnose, Feed, Scribe, Tap};
use teleclay_replay::Studio;
use teleclay_replay::again::How;
use teleclay_replay::verify::{Difference, Verdict, verify};
use teleclay_session::{Event, Session};
use teleclay_sim::rig::Ear;

const SECOND: Duration = Duration::from_secs(1);

fn driven_cuts(verdict: &Verdict) -> u64 {
    let driven = verdict.held.iter().filter(|held| held.how == How::Driven);
    driven.map(|held| held.cuts).sum()
}

/// Under every scheme, over a clean line and over a bad one: tools that joined within the recording cut through the
/// loop what they cut, and those that were held before cut by the history.
#[test]
fn every_scheme_comes_out() {
    for scheme in SCHEMES {
        for line in [line(0, 0.0, 0.0), line(20, 0.5, 0.05)] {
            let mut recorded = Recorded::new(scheme, line);
            recorded.rig.run_for(SECOND);
            recorded.rejoin(0);
            recorded.rig.run_for(2 * SECOND);
            let (file, hash) = recorded.finish();
            let verdict = verify(&file).unwrap();
            assert!(verdict.is_good(), "{scheme}: {:?}", verdict.difference);
            assert_eq!(verdict.hash, Some(hash), "{scheme}");
            assert!(3000 <= verdict.ticks, "{scheme}: {}", verdict.ticks);
            assert!(100 < driven_cuts(&verdict), "{scheme}: {:?}", verdict.held);
            let hows: Vec<_> = verdict
                .held
                .iter()
                .map(|held| (held.slot, held.how))
                .collect();
            assert_eq!(
                hows,
                [(0, How::Followed), (0, How::Driven), (1, How::Followed)],
                "{scheme}"
            );
            assert!(verdict.gaps.is_empty() && !verdict.is_cut_off);
        }
    }
}

/// Whatever commands come: pauses, other schemes, fresh blocks, other clay, operators who leave and come.
#[test]
fn random_commands_come_out() {
    for seed in 0..8 {
        let mut chance = Pcg32::new(seed, 0);
        let scheme = SCHEMES[seed as usize % SCHEMES.len()];
        let mut recorded = Recorded::new(scheme, line(10, 0.3, 0.02));
        recorded.rejoin(0);
        recorded.rejoin(1);
        for _ in 0..12 {
            let ms = 50 + u64::from(chance.next_u32() % 400);
            recorded.rig.run_for(Duration::from_millis(ms));
            command(&mut recorded, &mut chance);
        }
        recorded.rig.resume();
        recorded.rig.run_for(SECOND);
        let (file, hash) = recorded.finish();
        let verdict = verify(&file).unwrap();
        assert!(verdict.is_good(), "seed {seed}: {:?}", verdict.difference);
        assert_eq!(verdict.hash, Some(hash), "seed {seed}");
        assert!(0 < driven_cuts(&verdict), "seed {seed}: {:?}", verdict.held);
    }
}

/// One bit of the hand's force in one frame, with every checksum of the file made anew.
#[test]
fn a_changed_frame_is_noticed() {
    let mut recorded = Recorded::new(Scheme::ForceExchange, line(0, 0.0, 0.0));
    recorded.rejoin(0);
    recorded.rig.run_for(2 * SECOND);
    let (file, _) = recorded.finish();
    let mut seen = 0;
    let changed = rewritten(&file, |message| {
        let is_frame = message.channel.topic.ends_with("tool_1/handle_frame");
        seen += u32::from(is_frame);
        if is_frame && seen == 1500 {
            // Behind CDR's head, the arrival and the length.
            let bytes = &mut message.data.to_mut()[16..];
            let mut frame = HandleFrame::decode(bytes).unwrap();
            let force_n = &mut frame.hand_force_n[0];
            *force_n = f64::from_bits(force_n.to_bits() ^ (1 << 48));
            bytes.copy_from_slice(frame.encode(&mut [0; MAX_FRAME]));
        }
        true
    });
    assert_ne!(file, changed);
    let verdict = verify(&changed).unwrap();
    assert!(!verdict.is_good(), "{verdict:?}");
}

/// A tick without its frames, its records and its time, and nothing that says so.
#[test]
fn a_tick_that_is_left_out_is_noticed() {
    let mut recorded = Recorded::new(Scheme::Replica, line(0, 0.0, 0.0));
    recorded.rejoin(0);
    recorded.rig.run_for(2 * SECOND);
    let (file, _) = recorded.finish();
    let without = rewritten(&file, |message| message.log_time != 1_500_000_000);
    let verdict = verify(&without).unwrap();
    assert!(
        matches!(verdict.difference, Some(Difference::Missing { .. })),
        "{:?}",
        verdict.difference
    );
}

/// Nothing of a record of the history can be changed.
#[test]
fn a_changed_cut_is_noticed() {
    let mut recorded = Recorded::new(Scheme::Wave, line(0, 0.0, 0.0));
    recorded.rejoin(0);
    recorded.rig.run_for(2 * SECOND);
    let (file, _) = recorded.finish();
    let mut seen = 0;
    let changed = rewritten(&file, |message| {
        seen += u32::from(message.channel.topic.ends_with("/history"));
        if message.channel.topic.ends_with("/history") && seen == 1200 {
            let record = message.data.to_mut();
            let last = record.len() - 1;
            record[last] ^= 1;
        }
        true
    });
    assert_ne!(file, changed);
    let noticed = verify(&changed).map(|verdict| !verdict.is_good());
    assert!(noticed.unwrap_or(true));
}

/// A file that a killed program leaves: whatever its length, it can be read up to its last whole chunk.
#[test]
fn a_file_that_is_cut_off_anywhere_comes_out_up_to_there() {
    let mut recorded = Recorded::new(Scheme::PositionForce, line(0, 0.0, 0.0));
    recorded.rejoin(0);
    let mut flushed = Vec::new();
    for _ in 0..4 {
        recorded.rig.run_for(SECOND / 2);
        recorded.studio.flush().unwrap();
        let ticks = recorded.rig.session().ticks();
        flushed.push((recorded.file.bytes().len(), ticks));
    }
    let (file, _) = recorded.finish();
    let mut lengths: Vec<usize> = (0..file.len()).step_by(file.len() / 150).collect();
    lengths.extend(flushed.iter().map(|(length, _)| *length));
    for length in lengths {
        let whole = flushed.iter().filter(|(flushed, _)| *flushed <= length);
        let ticks = whole.map(|(_, ticks)| *ticks).max().unwrap_or(0);
        match verify(&file[..length]) {
            Ok(verdict) => {
                assert!(verdict.is_cut_off, "{length}");
                assert_eq!(verdict.difference, None, "{length}");
                // The recording itself begins some ticks in.
                assert!(ticks <= verdict.ticks + 20, "{length}: {}", verdict.ticks);
            }
            Err(error) => assert_eq!(ticks, 0, "{length}: {error}"),
        }
    }
}

/// Every topic has a message for each tick, as far as its tool was held.
#[test]
fn there_are_as_many_messages_as_ticks() {
    let mut recorded = Recorded::new(Scheme::Replica, line(0, 0.0, 0.0));
    recorded.rig.run_for(SECOND);
    let (file, _) = recorded.finish();
    let counts = counts(&file);
    let ticks = counts["/teleclay/rig/ticks"];
    assert!(1000 <= ticks, "{ticks}");
    for tool in [1, 2] {
        for topic in [
            "handle_pose",
            "tool_pose",
            "handle_twist",
            "tool_twist",
            "hand_wrench",
            "felt_wrench",
            "tool_wrench",
            "link",
            "energy",
            "corrections",
            "handle_frame",
        ] {
            let name = format!("/teleclay/rig/tool_{tool}/{topic}");
            assert_eq!(counts.get(&name), Some(&ticks), "{name}");
        }
    }
}

/// Once a second, by the time of the tick in which it is asked for.
#[test]
fn how_the_session_does_is_asked_once_a_second() {
    let mut rig = rig_of_two(Scheme::ForceExchange);
    let file = File::default();
    let about = About {
        diagnose: Some(Diagnose(Arc::new(|ns| ns.to_le_bytes().to_vec()))),
        ..about()
    };
    let studio = Studio::new(file.clone(), about, 2, 1).unwrap();
    rig.hear_with(Some(Box::new(studio.clone())));
    rig.run_for(SECOND * 11 / 2);
    studio.finish(rig.session_mut()).unwrap();
    let mut told = Vec::new();
    for message in mcap::MessageStream::new(&file.bytes()).unwrap() {
        let message = message.unwrap();
        if message.channel.topic == "/diagnostics" {
            assert_eq!(message.data[..], message.log_time.to_le_bytes());
            told.push(message.log_time);
        }
    }
    assert_eq!(told.len(), 6, "{told:?}");
    assert!(told.is_sorted_by(|one, next| next - one == 1_000_000_000));
}

/// Hears a rig, and lets what it heard wait from one tick to another.
struct Stalling {
    tap: Tap,
    feed: Feed,
    scribe: Arc<Mutex<Scribe<File>>>,
    stalls: Range<u64>,
}

impl Ear for Stalling {
    fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame) {
        self.tap.on_frame(slot, arrived, frame);
    }

    fn on_tick(&mut self, session: &mut Session, now: Timestamp, events: &[Event]) {
        self.tap.on_tick(session, now, events.iter());
        if !self.stalls.contains(&session.ticks()) {
            let mut scribe = self.scribe.lock().unwrap();
            scribe.take_from(&mut self.feed, usize::MAX).unwrap();
        }
    }
}

/// A writer that stalls for so long that the ring is full: what was lost is counted, and what follows is whole again.
#[test]
fn what_finds_no_room_is_counted_and_the_rest_comes_out() {
    let mut rig = rig_of_two(Scheme::ForceExchange);
    let file = File::default();
    let (tap, feed) = Tap::new(2, 1);
    let scribe = Arc::new(Mutex::new(Scribe::new(file.clone(), about()).unwrap()));
    rig.hear_with(Some(Box::new(Stalling {
        tap,
        feed,
        scribe: Arc::clone(&scribe),
        stalls: 500..12_000,
    })));
    rig.run_for(14 * SECOND);
    drop(rig.hear_with(None));
    scribe.lock().unwrap().finish("the run is over").unwrap();
    let counts = scribe.lock().unwrap().counts();
    assert!(100 < counts.dropped, "{counts:?}");
    let verdict = verify(&file.bytes()).unwrap();
    assert!(verdict.is_good(), "{:?}", verdict.difference);
    assert_eq!(verdict.gaps.len(), 1);
    assert_eq!(verdict.gaps[0].dropped, counts.dropped);
    assert!(verdict.gaps[0].to_tick < 12_100, "{:?}", verdict.gaps);
    assert_eq!(verdict.hash, Some(rig.session_mut().clay_mut().hash()));
}
