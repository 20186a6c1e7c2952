//! Would it help to foresee what another operator's tool has cut by now? Two operators work in one clay under the
//! replica, over lines and motions, with and without a forecast of the other's tool; what that does to what they feel
//! is printed side by side. What came of it stands in docs/latency.md.
//!
//! ```sh
//! cargo run --release -p teleclay-latency --example second_writer -- --seeds 20
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`forecast`] | where the other's tool is by now, under several laws |
//! | [`foreseeing`] | a replica whose hand feels the clay without what is foreseen to be cut |
//! | [`motions`] | what the two operators do |
//! | [`measure`] | one run against the run without a network, and many runs |

#![allow(clippy::print_stdout)] // the comparison

mod forecast;
mod foreseeing;
mod measure;
mod motions;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use teleclay_latency::cell::{Cell, Profile};
use teleclay_proto::Scheme;

use crate::forecast::Law;
use crate::measure::{Felt, Sum, reference, run};
use crate::motions::Motion;

/// The two kinds of line: jitter alone, as in the table's cells with a second writer, and bursts of losses besides.
const LINES: [(&str, Profile); 2] = [("iid", Profile::SecondWriter), ("bursts", Profile::Bursts)];
/// Jitter over the delay, as in the table's special lines.
const JITTER_RATIO: f64 = 0.2;

/// Runs two operators in one clay, with and without a forecast of the other's tool, and prints the comparison.
#[derive(Parser)]
struct Arguments {
    /// How many seeds each line of the comparison gets
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    /// One-way delays, ms
    #[arg(long, value_delimiter = ',', default_values_t = [25, 75, 150, 250])]
    delay_ms: Vec<u32>,
    /// Motions [default: all]: pushes, straight, circles, stops, tremor
    #[arg(long, value_delimiter = ',', value_parser = motion)]
    motion: Vec<Motion>,
    /// Laws [default: all]: none, straight, short, bent, damped, narrow, at_once, bounded, in_contact, trusted
    #[arg(long, value_delimiter = ',', value_parser = law)]
    law: Vec<Law>,
    /// Kinds of lines [default: all]: iid, bursts
    #[arg(long, value_delimiter = ',', value_parser = line)]
    line: Vec<Profile>,
    /// Threads that work
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
}

fn main() {
    let mut arguments = Arguments::parse();
    if arguments.motion.is_empty() {
        arguments.motion = Motion::ALL.to_vec();
    }
    if arguments.law.is_empty() {
        arguments.law = Law::ALL.to_vec();
    }
    if arguments.line.is_empty() {
        arguments.line = LINES.map(|(_, profile)| profile).to_vec();
    }
    println!("| motion | line | one way, ms | law | {} |", Sum::HEADINGS);
    let figures = Sum::HEADINGS.split(" | ").count();
    println!("|---|---|---:|---|{}", "---:|".repeat(figures));
    for &motion in &arguments.motion {
        for (cell, law, sum) in measure_motion(&arguments, motion) {
            println!(
                "| {} | {} | {} | {} | {sum} |",
                motion.word(),
                line_word(cell.profile),
                cell.delay_ms,
                law.word()
            );
        }
    }
}

/// Every cell and law over all seeds.
fn measure_motion(arguments: &Arguments, motion: Motion) -> Vec<(Cell, Law, Sum)> {
    let mut cells = Vec::new();
    for &profile in &arguments.line {
        for &delay_ms in &arguments.delay_ms {
            let cell = Cell {
                scheme: Scheme::Replica.into(),
                delay_ms,
                jitter_ratio: JITTER_RATIO,
                loss: 0.0,
                profile,
            };
            cells.extend(arguments.law.iter().map(|&law| (cell, law, Sum::default())));
        }
    }
    let plan: Vec<(Cell, Law)> = cells.iter().map(|&(cell, law, _)| (cell, law)).collect();
    let seeds = arguments.first_seed..arguments.first_seed + arguments.seeds;
    let seeds: Vec<u64> = seeds.collect();
    let outcomes = Mutex::new(vec![Vec::new(); seeds.len()]);
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..arguments.threads {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&seed) = seeds.get(number) else {
                        return;
                    };
                    let truth: Felt = reference(motion, seed);
                    let of_seed: Vec<_> = plan
                        .iter()
                        .map(|(cell, law)| run(motion, cell, *law, seed, &truth))
                        .collect();
                    outcomes.lock().expect(DONE)[number] = of_seed;
                }
            });
        }
    });
    // By seed, whichever thread was first: sums round alike then.
    for of_seed in outcomes.into_inner().expect(DONE) {
        for ((_, _, sum), outcome) in cells.iter_mut().zip(of_seed) {
            sum.add(outcome);
        }
    }
    cells
}

const DONE: &str = "a worker that panics ends the program";

fn motion(word: &str) -> Result<Motion, String> {
    let known = Motion::ALL.into_iter().find(|motion| motion.word() == word);
    known.ok_or_else(|| format!("no motion is called {word}"))
}

fn law(word: &str) -> Result<Law, String> {
    let known = Law::ALL.into_iter().find(|law| law.word() == word);
    known.ok_or_else(|| format!("no law is called {word}"))
}

fn line(word: &str) -> Result<Profile, String> {
    let known = LINES.into_iter().find(|(known, _)| *known == word);
    known
        .map(|(_, profile)| profile)
        .ok_or_else(|| format!("no line is called {word}"))
}

fn line_word(profile: Profile) -> &'static str {
    LINES
        .into_iter()
        .find(|(_, known)| *known == profile)
        .map_or("", |(word, _)| word)
}
