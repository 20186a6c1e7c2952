//! `teleclay-replay`: a recording through the loop once more.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context as _, Result};
use clap::Parser;
use teleclay_link::conditioner::Impairment;
use teleclay_proto::Scheme;
use teleclay_replay::again::How;
use teleclay_replay::felt::Hand;
use teleclay_replay::moment::moments;
use teleclay_replay::verify::{Difference, Verdict, verify};
use teleclay_replay::{Felt, Question};
use teleclay_session::Lines;

/// Runs a recording through the loop once more, on virtual time.
///
/// With `--verify` everything happens as it was recorded, and must come out bit for bit: exit code 1 and the first tick
/// that differs where it does not. Without, the recorded hand is played by a simulated person, under another scheme or
/// over another line if one is given, and what it feels is compared with what was felt.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// The recording
    file: PathBuf,
    /// Check that clay and cuts come out
    #[arg(long, conflicts_with_all = ["tool", "scheme", "delay_ms", "rtt_ms", "jitter", "loss", "seed", "out"])]
    verify: bool,
    /// Print what the recording tells of this moment, s since it began, as a line of JSON: tools, settings, the clay's
    /// hash; several times for several moments
    #[arg(long, value_name = "S", conflicts_with_all = ["verify", "tool", "scheme", "delay_ms", "rtt_ms", "jitter", "loss", "seed", "out"])]
    at_s: Vec<f64>,
    /// Whose hand, by tool [default: the one of which there is most]
    #[arg(long, value_name = "NUMBER")]
    tool: Option<u32>,
    /// Under this scheme
    #[arg(long, value_name = "SCHEME")]
    scheme: Option<Scheme>,
    /// Over a line with this one-way delay, ms
    #[arg(long, value_name = "MS", conflicts_with = "rtt_ms", value_parser = clap::value_parser!(u32).range(..=1000))]
    delay_ms: Option<u32>,
    /// Likewise, there and back, ms
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(..=2000))]
    rtt_ms: Option<u32>,
    /// Its jitter, over the delay
    #[arg(long, value_name = "RATIO", default_value_t = 0.0, value_parser = share)]
    jitter: f64,
    /// The share of frames that it loses
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    loss: f64,
    /// What chance the line has
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Write a recording of it
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("teleclay-replay: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    let path = &arguments.file;
    let file = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    if !arguments.at_s.is_empty() {
        tell_moments(&moments(&file, &arguments.at_s)?);
        return Ok(ExitCode::SUCCESS);
    }
    if arguments.verify {
        let verdict = verify(&file)?;
        tell(&verdict);
        return Ok(if verdict.is_good() {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        });
    }
    let question = Question {
        tool: arguments.tool,
        scheme: arguments.scheme,
        lines: lines(arguments),
    };
    let out = arguments.out.as_ref().map(|path| {
        let file = File::create_new(path);
        file.with_context(|| format!("cannot write {}", path.display()))
    });
    let out = out.transpose()?.map(BufWriter::new);
    let felt = Hand::read(&file, question.tool)?.feel(&question, out)?;
    tell_felt(&felt);
    Ok(ExitCode::SUCCESS)
}

/// The line that is asked for, if one is.
fn lines(arguments: &Arguments) -> Option<Lines> {
    let one_way = arguments
        .delay_ms
        .map(|ms| Duration::from_millis(ms.into()));
    let there_and_back = arguments
        .rtt_ms
        .map(|ms| Duration::from_millis(ms.into()) / 2);
    let is_asked_for = 0.0 < arguments.loss || 0.0 < arguments.jitter;
    let delay = one_way
        .or(there_and_back)
        .or(is_asked_for.then_some(Duration::ZERO))?;
    let line = Impairment {
        delay,
        jitter: delay.mul_f64(arguments.jitter),
        loss: arguments.loss,
        ..Impairment::default()
    };
    Some(Lines {
        up: line,
        up_seed: arguments.seed.wrapping_mul(2),
        down: line,
        down_seed: arguments.seed.wrapping_mul(2).wrapping_add(1),
    })
}

fn share(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if (0.0..=1.0).contains(&number) {
        return Ok(number);
    }
    Err(format!("{number} is not from 0 to 1"))
}

#[expect(clippy::print_stdout, reason = "a program's answer")]
fn tell_moments(moments: &[serde_json::Value]) {
    for moment in moments {
        println!("{moment}");
    }
}

#[expect(clippy::print_stdout, reason = "a program's answer")]
fn tell(verdict: &Verdict) {
    println!("{} ticks", verdict.ticks);
    for held in &verdict.held {
        let (tool, cuts) = (held.slot + 1, held.cuts);
        let how = match held.how {
            How::Driven => "through the loop by the recorded frames",
            How::Followed | How::Free => {
                "held before that, so what its controllers remembered is unknown: cut by the history"
            }
        };
        println!(
            "tool {tool}, {}, {} ticks, {cuts} cuts: {how}",
            held.operator, held.ticks
        );
    }
    for gap in &verdict.gaps {
        println!(
            "ticks {} to {} lead nowhere ({} found no room in the recording): begun anew after them",
            gap.from_tick,
            gap.to_tick - 1,
            gap.dropped
        );
    }
    if verdict.is_cut_off {
        println!("the file was cut off: everything up to its last whole chunk was gone through");
    }
    match (&verdict.difference, verdict.hash) {
        (Some(difference), _) => println!("DIFFERS: {}", words(difference)),
        (None, Some(hash)) => println!(
            "the same clay: {hash:016x}, {} hashes compared",
            verdict.hashes
        ),
        (None, None) => println!("nothing to compare: the recording has no hash"),
    }
}

fn words(difference: &Difference) -> String {
    match difference {
        Difference::Cuts {
            tick,
            slot,
            told,
            got,
        } => format!(
            "in tick {tick} tool {} made {} cuts that moved {} units, and the recording says {} and {}",
            slot + 1,
            got.cuts.len(),
            got.moved_units,
            told.cuts.len(),
            told.moved_units
        ),
        Difference::Clay {
            tick,
            by,
            told,
            got,
        } => format!(
            "after tick {tick} the clay by {by} has the hash {got:016x}, and the recording says {told:016x}"
        ),
        Difference::History { tick, why } => {
            format!("in tick {tick} the history does not follow: {why}")
        }
        Difference::Frame { tick, slot } => {
            format!("in tick {tick} what came for tool {} is no frame", slot + 1)
        }
        Difference::Missing { after, tick } => format!(
            "tick {tick} follows tick {after}, and the recording does not say that any was dropped"
        ),
    }
}

#[expect(clippy::print_stdout, reason = "a program's answer")]
fn tell_felt(felt: &Felt) {
    let [then, now] = felt.schemes;
    println!("tool {}, {:.1} s", felt.tool, felt.lasts_s);
    println!("          scheme        rms N   peak N");
    for (when, scheme, force) in [("then", then, felt.then), ("now", now, felt.now)] {
        println!(
            "{when:<9} {:<12} {:>6.3} {:>8.3}",
            scheme.to_string(),
            force.rms_n,
            force.peak_n
        );
    }
    match felt.force_nrmse {
        Some(nrmse) => println!("force NRMSE {nrmse:.3}"),
        None => println!("nothing was felt then"),
    }
    println!(
        "the hand is {:.2} mm off its way (rms)",
        felt.position_rmse_m * 1e3
    );
}
