//! Writes a recording of two operators who cut, on virtual time: `record FILE SECONDS`.

#![allow(clippy::print_stdout, reason = "the counts are the result")]

#[path = "../tests/rigs/mod.rs"]
mod rigs;

use std::fs::File;
use std::time::Duration;

use rigs::{about, rig_of_two};
use teleclay_proto::Scheme;
use teleclay_replay::Studio;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (path, seconds) = (arguments.next(), arguments.next());
    let (Some(path), Some(seconds)) = (path, seconds.and_then(|text| text.parse().ok())) else {
        eprintln!("record FILE SECONDS");
        std::process::exit(2);
    };
    let file = File::create(path).expect("the file can be written");
    let mut rig = rig_of_two(Scheme::Replica);
    let studio = Studio::new(file, about(), 2, 1).expect("the file can be begun");
    rig.hear_with(Some(Box::new(studio.clone())));
    rig.run_for(Duration::from_secs(seconds));
    studio.finish(rig.session_mut()).expect("the disk has room");
    println!("{:016x}", rig.session_mut().clay_mut().hash());
}
