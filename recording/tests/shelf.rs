//! The recordings of a server, from their beginning to whatever ends them.

#[path = "../../crates/session/tests/bench/mod.rs"]
mod bench;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use bench::{Bench, cutting, stroke};
use teleclay_proto::http::RecordingState;
use teleclay_proto::{Scheme, SessionId};
use teleclay_recording::{About, Feed, Shelf, ShelfError, Tap};
use teleclay_reel::{Recorded, Step};

/// A folder that goes with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = format!("shelf-{name}-{}", std::process::id());
        Self(Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder))
    }

    fn shelf(&self) -> Shelf {
        Shelf::lasting(self.0.clone())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left over is the next build's to clear.
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn id(name: &str) -> SessionId {
    SessionId::new(name).unwrap()
}

fn about() -> About {
    About {
        session: "bench".to_owned(),
        offset_ns: 0,
        topics: None,
        diagnose: None,
    }
}

/// What a tap has of so many ticks of an operator who cuts.
fn recorded(ticks: u32) -> Feed {
    let mut bench = Bench::new(cutting(Scheme::PositionForce));
    let mut hand = bench.join("Ada").unwrap();
    let (mut tap, feed) = Tap::new(bench.session.tools(), 1);
    for tick in 0..ticks {
        let frame = hand.frame(bench.now, stroke(tick));
        bench.session.handle_frame(bench.now, hand.slot, &frame);
        let now = bench.now;
        bench.session.tick_heard(now, |slot, arrived, frame| {
            tap.on_frame(slot, arrived, frame)
        });
        let events = bench.take_events();
        tap.on_tick(&mut bench.session, now, events.iter());
        bench.now = now.after(bench::TICK);
    }
    tap.end(&mut bench.session);
    feed
}

/// A recording is written to its end, told, refused a second time by its name, and deleted.
#[test]
fn a_recording_has_a_beginning_and_an_end() {
    let folder = Folder::new("life");
    let shelf = folder.shelf();
    let (session, one) = (id("bench"), id("one"));
    assert_eq!(shelf.list(&session).unwrap(), []);
    shelf.start(&one, about(), recorded(1000)).unwrap();
    let ended = shelf.stop(&session, &one, "enough").unwrap();
    assert_eq!(ended.state, RecordingState::Ended);
    assert!(900 < ended.ticks && ended.dropped == 0, "{ended:?}");
    let file = fs::read(shelf.file(&session, &one).unwrap()).unwrap();
    assert_eq!(file.len() as u64, ended.bytes);
    let mut steps = Recorded::new(&file).unwrap();
    let ticks = steps
        .by_ref()
        .filter(|step| matches!(step, Ok(Step::Ticked(_))));
    assert_eq!(ticks.count() as u64, ended.ticks);
    assert!(!steps.is_cut_off());
    assert_eq!(folder.shelf().list(&session).unwrap(), [ended]);
    let again = shelf.start(&one, about(), recorded(10));
    assert!(matches!(again, Err(ShelfError::Exists { .. })));
    shelf.delete(&session, &one).unwrap();
    assert_eq!(shelf.list(&session).unwrap(), []);
    assert!(matches!(
        shelf.delete(&session, &one),
        Err(ShelfError::Missing { .. })
    ));
}

/// A recording that its server did not end is told as interrupted by the next one.
#[test]
fn what_a_killed_server_leaves_is_told() {
    let folder = Folder::new("killed");
    let (session, one) = (id("bench"), id("one"));
    {
        let shelf = folder.shelf();
        shelf.start(&one, about(), recorded(1000)).unwrap();
        shelf.stop(&session, &one, "enough").unwrap();
    }
    // As it is before the end is noted.
    let slip = folder.0.join("bench/one.json");
    let noted = fs::read_to_string(&slip).unwrap();
    fs::write(&slip, noted.replace("\"ended\"", "\"recording\"")).unwrap();
    let told = folder.shelf().recording(&session, &one).unwrap();
    assert_eq!(told.state, RecordingState::Interrupted);
    fs::remove_file(&slip).unwrap();
    let told = folder.shelf().recording(&session, &one).unwrap();
    assert_eq!(told.state, RecordingState::Interrupted);
}

/// A session has one recording at a time.
#[test]
fn one_at_a_time() {
    let folder = Folder::new("one");
    let shelf = folder.shelf();
    let bench = Bench::new(cutting(Scheme::Replica));
    let (tap, feed) = Tap::new(bench.session.tools(), 1);
    shelf.start(&id("one"), about(), feed).unwrap();
    let second = shelf.start(&id("two"), about(), recorded(1));
    assert!(matches!(second, Err(ShelfError::Running { .. })));
    assert_eq!(shelf.running_of(&id("bench")), Some(id("one")));
    drop(tap);
    shelf.stop(&id("bench"), &id("one"), "enough").unwrap();
    shelf.start(&id("two"), about(), recorded(1)).unwrap();
}

/// Everybody on the machine writes where the system has what is temporary.
#[test]
fn what_is_temporary_is_nobody_elses_to_foresee_or_to_read_and_goes() {
    let shelves = [Shelf::temporary(), Shelf::temporary()];
    let roots = shelves.each_ref().map(|shelf| {
        shelf.start(&id("a"), about(), recorded(20)).unwrap();
        shelf.stop(&id("bench"), &id("a"), "enough").unwrap();
        let file = shelf.file(&id("bench"), &id("a")).unwrap();
        file.ancestors().nth(2).unwrap().to_owned()
    });
    assert_ne!(roots[0], roots[1]);
    for root in &roots {
        let mode = fs::metadata(root).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o700, "{mode:o}");
    }
    drop(shelves);
    assert!(!roots.iter().any(|root| root.exists()));
}
