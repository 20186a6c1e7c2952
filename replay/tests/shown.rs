//! A recording shown at any moment is the session as it was then: clay to the last bit, and every number of its tools.

mod rigs;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use mcap::MessageStream;
use rand_core::Rng as _;
use rand_pcg::Pcg32;
use rigs::{Recorded, SCHEMES, command, counts, line, rewritten};
use teleclay_bilateral::ToolView;
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::HandleFrame;
use teleclay_reel::reel::End;
use teleclay_reel::scene::{Why, quantity};
use teleclay_reel::{ReadError, Reel};
use teleclay_session::{Event, Exchange, ExchangedClay, Prepared, Session};
use teleclay_sim::rig::Ear;

const SECOND: Duration = Duration::from_secs(1);

/// A tick of the session itself.
struct Truth {
    tick: u64,
    hash: u64,
    tools: Vec<Option<ToolView>>,
}

/// By the tick's time, ns.
type Truths = Arc<Mutex<BTreeMap<u64, Truth>>>;

/// Hears a rig twice: one ear records it, the other keeps what is true.
struct Witness(Box<dyn Ear>, Truths);

impl Ear for Witness {
    fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame) {
        self.0.on_frame(slot, arrived, frame);
    }

    fn on_tick(&mut self, session: &mut Session, now: Timestamp, events: &[Event]) {
        self.0.on_tick(session, now, events);
        let truth = Truth {
            tick: session.ticks(),
            hash: session.clay_mut().hash(),
            tools: (0..session.tools())
                .map(|slot| session.side(slot).map(|side| side.view()))
                .collect(),
        };
        self.1.lock().unwrap().insert(now.as_nanos(), truth);
    }
}

fn witnessed(scheme: Scheme) -> (Recorded, Truths) {
    let mut recorded = Recorded::new(scheme, line(10, 0.3, 0.02));
    let truths = Truths::default();
    let studio = recorded.rig.hear_with(None).unwrap();
    let witness = Witness(studio, Arc::clone(&truths));
    recorded.rig.hear_with(Some(Box::new(witness)));
    (recorded, truths)
}

/// Read in pieces of any length.
fn read(file: &[u8], reel: &mut Reel, chance: &mut Pcg32) -> Result<(), ReadError> {
    let mut rest = file;
    while !rest.is_empty() {
        let length = 1 + chance.next_u32() as usize % 300_000;
        let (piece, behind) = rest.split_at(length.min(rest.len()));
        reel.push(piece)?;
        rest = behind;
    }
    reel.push(&[])
}

/// Goes to a moment; gives the bytes that had to be read again for it.
fn show(file: &[u8], reel: &mut Reel, time_ns: u64) -> usize {
    reel.seek(time_ns).unwrap();
    let mut bytes = 0;
    while let Some(want) = reel.want() {
        let from = usize::try_from(want.offset).unwrap();
        bytes += want.length;
        reel.give(&file[from..from + want.length]).unwrap();
    }
    bytes
}

fn assert_shows(file: &[u8], reel: &mut Reel, time_ns: u64, truth: &Truth) {
    show(file, reel, time_ns);
    let scene = reel.scene();
    assert_eq!(scene.head.tick, Some(truth.tick));
    let hash = scene.clay().map(teleclay_clay::Clay::hash);
    assert_eq!(hash, Some(truth.hash), "in tick {}", truth.tick);
    for (slot, told) in truth.tools.iter().enumerate() {
        let Some(told) = told else { continue };
        let values = &scene.head.tools[slot].values;
        let vectors = [
            (quantity::HAND_FORCE_N, told.hand_force_n),
            (quantity::FELT_FORCE_N, told.felt_force_n),
            (quantity::TOOL_FORCE_N, told.force_n),
            (quantity::HANDLE_POSITION_M, told.handle_position_m),
            (quantity::TOOL_POSITION_M, told.position_m),
            (quantity::HANDLE_VELOCITY_M_S, told.handle_velocity_m_s),
            (quantity::TOOL_VELOCITY_M_S, told.velocity_m_s),
        ];
        for (at, vector) in vectors {
            let got: Vec<_> = values[at..at + 3].iter().map(|v| v.to_bits()).collect();
            let want = vector.map(f64::to_bits);
            assert_eq!(got, want, "quantity {at} of slot {slot}");
        }
        let energies = [told.energy_handle_j, -told.energy_tool_j];
        let got = [
            values[quantity::ENERGY_HANDLE_J],
            values[quantity::ENERGY_TOOL_J],
        ];
        assert_eq!(got.map(f64::to_bits), energies.map(f64::to_bits));
    }
    let held: Vec<_> = truth.tools.iter().map(Option::is_some).collect();
    let shown: Vec<_> = scene.holders().map(|name| name.is_some()).collect();
    assert_eq!(shown, held, "who holds a tool in tick {}", truth.tick);
}

/// Whatever commands come: moments in any order, back and forth, each as the session was.
#[test]
fn any_moment_is_the_session_as_it_was() {
    for seed in 0..5 {
        let mut chance = Pcg32::new(seed, 0);
        let (mut recorded, truths) = witnessed(SCHEMES[seed as usize]);
        for _ in 0..16 {
            let ms = 50 + u64::from(chance.next_u32() % 900);
            recorded.rig.run_for(Duration::from_millis(ms));
            command(&mut recorded, &mut chance);
        }
        recorded.rig.resume();
        recorded.rig.run_for(SECOND);
        let (file, hash) = recorded.finish();
        let mut reel = Reel::new();
        read(&file, &mut reel, &mut chance).unwrap();
        let facts = reel.facts().clone();
        assert_eq!((facts.end, facts.differs_ns), (End::Whole, None));
        assert_eq!(facts.reason.as_deref(), Some("the run is over"));
        assert_eq!(facts.hash, Some([hash, hash]), "the clay at the end");
        assert!(5 <= facts.hashes, "{} hashes", facts.hashes);
        assert_eq!(facts.bytes, file.len() as u64);
        assert!(reel.gaps().is_empty(), "{:?}", reel.gaps());
        let truths = truths.lock().unwrap();
        let all: Vec<_> = truths.range(facts.from_ns..=facts.to_ns).collect();
        let ticks = counts(&file)["/teleclay/rig/ticks"] as u64;
        assert_eq!(ticks, facts.ticks);
        for _ in 0..60 {
            let (time_ns, truth) = all[chance.next_u32() as usize % all.len()];
            assert_shows(&file, &mut reel, *time_ns, truth);
        }
        // As it is played: forwards, a few ticks at a time, and no chunk is read twice for it.
        let begin = all.len() / 3;
        show(&file, &mut reel, *all[begin].0);
        let mut bytes = 0;
        for (time_ns, truth) in all[begin..].iter().step_by(37).take(60) {
            bytes += show(&file, &mut reel, **time_ns);
            assert_shows(&file, &mut reel, **time_ns, truth);
        }
        assert!(bytes <= file.len(), "{bytes} bytes of {}", file.len());
    }
}

/// Little memory makes long ways, and the same moments.
#[test]
fn keyframes_stay_within_their_bound() {
    let (mut recorded, truths) = witnessed(Scheme::Replica);
    recorded.rig.run_for(40 * SECOND);
    let (file, _) = recorded.finish();
    let mut chance = Pcg32::new(1, 0);
    let mut roomy = Reel::new();
    read(&file, &mut roomy, &mut chance).unwrap();
    let all_bytes = roomy.keyframe_bytes();
    let mut reel = Reel::new().with_keyframe_bytes(all_bytes / 3);
    read(&file, &mut reel, &mut chance).unwrap();
    assert!(reel.keyframe_bytes() <= all_bytes / 3);
    assert!(roomy.keyframe_ns() < reel.keyframe_ns());
    let truths = truths.lock().unwrap();
    let all: Vec<_> = truths
        .range(reel.facts().from_ns..=reel.facts().to_ns)
        .collect();
    for reel in [&mut roomy, &mut reel] {
        let per_ns = file.len() as f64 / (reel.facts().to_ns - reel.facts().from_ns) as f64;
        // A keyframe stands at a chunk's end, and the file's own states are in the way.
        let most = (1.5 * per_ns * reel.keyframe_ns() as f64) as usize + 1_000_000;
        for _ in 0..20 {
            let (time_ns, truth) = all[chance.next_u32() as usize % all.len()];
            // From the far end, so that nothing is there already.
            show(&file, reel, *all[0].0);
            let bytes = show(&file, reel, *time_ns);
            assert!(bytes < most, "{bytes} bytes, want {most} at most");
            assert_shows(&file, reel, *time_ns, truth);
        }
    }
}

/// While the rest still comes, what is there can be shown; and the place where a killed program's file ends is its end.
#[test]
fn a_file_that_ends_anywhere_is_shown_up_to_there() {
    let (mut recorded, truths) = witnessed(Scheme::ForceExchange);
    recorded.rig.run_for(3 * SECOND);
    let (file, _) = recorded.finish();
    let mut shown = 0;
    for length in (1..file.len()).step_by(file.len() / 60) {
        let mut reel = Reel::new();
        reel.push(&file[..length]).unwrap();
        assert_eq!(reel.facts().end, End::Ahead);
        reel.push(&[]).unwrap();
        assert_eq!(reel.facts().end, End::CutOff);
        let facts = reel.facts().clone();
        if facts.ticks == 0 {
            continue;
        }
        // A chunk may end within a tick.
        let truths = truths.lock().unwrap();
        let (time_ns, truth) = truths.range(..facts.to_ns).next_back().unwrap();
        if facts.from_ns <= *time_ns {
            assert_shows(&file, &mut reel, *time_ns, truth);
            shown += 1;
        }
    }
    assert!(40 < shown, "{shown} were shown");
}

/// Without some ticks nobody knows the clay, until the next state: that is said, and not another clay shown.
#[test]
fn what_a_gap_hides_is_said() {
    let (mut recorded, truths) = witnessed(Scheme::Wave);
    recorded.rig.run_for(3 * SECOND);
    let (file, hash) = recorded.finish();
    let lost = 1_500_000_000..1_600_000_000;
    let file = rewritten(&file, |message| !lost.contains(&message.log_time));
    let mut reel = Reel::new();
    read(&file, &mut reel, &mut Pcg32::new(0, 0)).unwrap();
    let [gap] = reel.gaps() else {
        panic!("{:?}", reel.gaps())
    };
    assert_eq!(gap.lost.why, Why::Missing { ticks: 100 });
    let facts = reel.facts().clone();
    // The state at the file's end.
    assert_eq!(gap.until_ns, Some(facts.to_ns));
    assert_eq!(gap.lost.since_ns, lost.end);
    show(&file, &mut reel, 2_000_000_000);
    let lost = reel.gaps()[0].lost.clone();
    assert_eq!(reel.scene().head.lost, Some(lost));
    assert!(reel.scene().clay().is_none());
    show(&file, &mut reel, facts.to_ns);
    let scene = reel.scene();
    assert_eq!(scene.clay().map(teleclay_clay::Clay::hash), Some(hash));
    let truths = truths.lock().unwrap();
    assert_shows(&file, &mut reel, 1_400_000_000, &truths[&1_400_000_000]);
}

/// After an undo the clay is the one that came of it, or is not shown: never the one before.
#[test]
fn an_undo_is_shown_as_it_was() {
    let (mut recorded, truths) = witnessed(Scheme::ForceExchange);
    recorded.rig.run_for(6 * SECOND);
    let session = recorded.rig.session();
    let exchanged = ExchangedClay {
        clay: recorded.rig.block().clone(),
        clay_epoch: session.clay_epoch(),
        exchange: Exchange::UndoneSince { stroke: 1 },
        as_of_tick: session.ticks(),
    };
    let mut prepared = Prepared::exchange(exchanged, session.settings());
    let (now, at) = (recorded.rig.now(), session.ticks());
    let session = recorded.rig.session_mut();
    session.handle_command(now, &mut prepared).unwrap();
    recorded.rig.run_for(2 * SECOND);
    let (file, hash) = recorded.finish();
    let mut reel = Reel::new();
    read(&file, &mut reel, &mut Pcg32::new(0, 0)).unwrap();
    let facts = reel.facts().clone();
    assert_eq!((facts.differs_ns, facts.hash), (None, Some([hash, hash])));
    let truths = truths.lock().unwrap();
    let mut known = 0;
    for (time_ns, truth) in truths.range(facts.from_ns..=facts.to_ns).step_by(13) {
        show(&file, &mut reel, *time_ns);
        if let Some(clay) = reel.scene().clay() {
            assert_eq!(clay.hash(), truth.hash, "in tick {}", truth.tick);
            known += usize::from(at < truth.tick);
        }
    }
    // A few ticks bring the next state.
    assert!(140 < known, "{known} of 153 moments after the undo");
}

/// Against another reader and plain arithmetic: no peak is lost, and none is made up.
#[test]
fn the_overview_has_every_peak() {
    let (mut recorded, _) = witnessed(Scheme::PositionForce);
    recorded.rig.run_for(20 * SECOND);
    let (file, _) = recorded.finish();
    let mut reel = Reel::new();
    read(&file, &mut reel, &mut Pcg32::new(0, 0)).unwrap();
    let overview = reel.overview().unwrap();
    assert!(1_000_000 < overview.width_ns(), "columns were joined");
    let (from_ns, to_ns) = (reel.facts().from_ns, reel.facts().to_ns);
    for (tool, topic, at, of) in [
        (1, "hand_wrench", quantity::HAND_FORCE_N, 0),
        (2, "tool_pose", quantity::TOOL_POSITION_M + 2, 2),
    ] {
        let mut told = Vec::new();
        for message in MessageStream::new(&file).unwrap() {
            let message = message.unwrap();
            if message
                .channel
                .topic
                .ends_with(&format!("tool_{tool}/{topic}"))
            {
                // Behind CDR's head, a stamp and the frame's name, at a multiple of eight.
                let length = u32::from_le_bytes(message.data[12..16].try_into().unwrap());
                let first = 4 + (12 + length as usize).next_multiple_of(8) + 8 * of;
                let value = message.data[first..first + 8].try_into().unwrap();
                told.push((message.log_time, f64::from_le_bytes(value) as f32));
            }
        }
        assert!(19_000 < told.len());
        // The whole in one column.
        let all = overview.envelope(tool - 1, at, [from_ns, to_ns + 1], 1)[0];
        let least = told
            .iter()
            .map(|(_, value)| *value)
            .fold(f32::INFINITY, f32::min);
        let most = told
            .iter()
            .map(|(_, value)| *value)
            .fold(-f32::INFINITY, f32::max);
        assert_eq!(
            [all.least, all.greatest].map(f32::to_bits),
            [least, most].map(f32::to_bits)
        );
        // Columns of the overview itself: each has what was told within it.
        let width_ns = overview.width_ns();
        let count = (to_ns - from_ns) / width_ns + 1;
        let span = [from_ns, from_ns + count * width_ns];
        let found = overview.envelope(tool - 1, at, span, count as usize);
        for (n, column) in found.iter().enumerate() {
            let begin = from_ns + n as u64 * width_ns;
            let within = told
                .iter()
                .filter(|(ns, _)| (begin..begin + width_ns).contains(ns));
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for (_, value) in within {
                (low, high) = (low.min(*value), high.max(*value));
            }
            let got = [column.least, column.greatest].map(f32::to_bits);
            assert_eq!(got, [low, high].map(f32::to_bits), "column {n}");
        }
    }
}

#[test]
fn what_is_no_recording_is_said_in_words() {
    let words = |file: &[u8]| {
        let mut reel = Reel::new();
        let outcome = read(file, &mut reel, &mut Pcg32::new(0, 0));
        outcome.unwrap_err().to_string()
    };
    assert_eq!(
        words(b"solid teapot\nendsolid teapot\n"),
        "this is no MCAP file: it begins otherwise"
    );
    let mut recorded = Recorded::new(Scheme::Wave, line(0, 0.0, 0.0));
    recorded.rig.run_for(SECOND);
    let (file, _) = recorded.finish();
    let others = rewritten(&file, |message| message.channel.topic == "/tf");
    assert!(words(&others).contains("is no recording of a session"));
    // The first byte of a state, behind CDR's head, epoch, hash, the format's name and the length, is its version.
    let newer = rewritten(&file, |message| {
        if message.channel.topic.ends_with("/clay") {
            let data = message.data.to_mut();
            let length = u32::from_le_bytes(data[20..24].try_into().unwrap()) as usize;
            let state = 4 + (20 + length).next_multiple_of(4) + 4;
            if let Some(version) = data.get_mut(state) {
                *version = 99;
            }
        }
        true
    });
    let said = words(&newer);
    assert!(
        said.contains("version 99 is newer than") && said.contains("a state in it"),
        "{said}"
    );
    // A bit in what the file has of indices harms nothing; anywhere else it is noticed, and nothing panics.
    let mut noticed = 0;
    for at in (0..file.len()).step_by(file.len() / 50) {
        let mut broken = file.clone();
        broken[at] ^= 0x10;
        let mut reel = Reel::new();
        match read(&broken, &mut reel, &mut Pcg32::new(0, 0)) {
            Ok(()) => assert_eq!(reel.facts().differs_ns, None),
            Err(error) => {
                let said = error.to_string();
                assert!(said.contains("damaged") || said.contains("MCAP"), "{said}");
                noticed += 1;
            }
        }
    }
    assert!(25 < noticed, "{noticed} of 51 were noticed");
}
