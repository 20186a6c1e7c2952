//! What a recording of two tools that cut costs: time of a processor for the tick and for the thread that writes, as a
//! share of one core. Linux alone tells a thread its own time.

#![allow(clippy::print_stdout, reason = "the figures are the result")]

#[path = "../tests/rigs/mod.rs"]
mod rigs;

use std::time::{Duration, Instant};

use rigs::rig_of_two;
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::HandleFrame;
use teleclay_recording::{About, Scribe, Tap};
use teleclay_session::{Event, Session};
use teleclay_sim::rig::Ear;

/// The rig's ear, and the time that it takes.
struct Timed {
    tap: Tap,
    scribe: Scribe<std::fs::File>,
    feed: teleclay_recording::Feed,
    tick_s: f64,
    write_s: f64,
    ticks: u32,
}

/// What takes longer than this on the tick was interrupted.
const INTERRUPTED: Duration = Duration::from_micros(200);

impl Timed {
    fn add(&mut self, began: Instant) {
        let took = began.elapsed();
        if took < INTERRUPTED {
            self.tick_s += took.as_secs_f64();
        }
    }
}

/// Time of a processor that this thread has had, s.
fn processor_s() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").expect("this is Linux");
    let ns = told.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    ns.expect("the first number is the time on a processor") * 1e-9
}

impl Ear for Timed {
    fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame) {
        let began = Instant::now();
        self.tap.on_frame(slot, arrived, frame);
        self.add(began);
    }

    fn on_tick(&mut self, session: &mut Session, now: Timestamp, events: &[Event]) {
        let began = Instant::now();
        self.tap.on_tick(session, now, events.iter());
        self.add(began);
        self.ticks += 1;
        // As often as the thread looks.
        if self.ticks.is_multiple_of(20) {
            let began_s = processor_s();
            self.scribe
                .take_from(&mut self.feed, 4096)
                .expect("the disk has room");
            if self.ticks.is_multiple_of(1000) {
                self.scribe.flush().expect("the disk has room");
            }
            self.write_s += processor_s() - began_s;
        }
        if self.ticks.is_multiple_of(10_000) {
            let virtual_s = f64::from(self.ticks) * 1e-3;
            println!(
                "{virtual_s} s: the tick {:.2} %, the thread {:.2} % of a core",
                1e2 * self.tick_s / virtual_s,
                1e2 * self.write_s / virtual_s
            );
        }
    }
}

fn main() {
    let path = std::env::temp_dir().join("teleclay-cost.mcap");
    let about = About {
        session: "rig".to_owned(),
        offset_ns: 0,
        topics: None,
        diagnose: None,
    };
    let (tap, feed) = Tap::new(2, 1);
    let file = std::fs::File::create(&path).expect("the temporary folder can be written");
    let scribe = Scribe::new(file, about).expect("the file can be begun");
    let mut rig = rig_of_two(Scheme::Replica);
    rig.hear_with(Some(Box::new(Timed {
        tap,
        scribe,
        feed,
        tick_s: 0.0,
        write_s: 0.0,
        ticks: 0,
    })));
    rig.run_for(Duration::from_secs(60));
    drop(rig.hear_with(None));
    let bytes = std::fs::metadata(&path).map_or(0, |file| file.len());
    println!("{:.2} MB/s", bytes as f64 / 60.0 / 1e6);
}
