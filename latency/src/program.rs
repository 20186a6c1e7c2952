//! `teleclay-latency`: what delay, jitter and loss do to the hand and to the clay, under every scheme, and under those
//! of one's own that a program brings along.
//!
//! Everything runs on virtual time from seeds: the same arguments give the same figures on every machine, to the last
//! bit.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use clap::Parser;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use teleclay_proto::join::LoopParameters;

use crate::cell::{Cell, Extent, Profile, SCHEMES, cells_of};
use crate::law::{Law, OwnScheme};
use crate::report::{Document, Measure, heatmap, markdown, summary};
use crate::run::{self, Outcome};
use crate::table::Row;
use crate::wall::{self, WallRow};

/// Seeds of the published table, and of the quick one.
const FULL_SEEDS: u64 = 30;
const QUICK_SEEDS: u64 = 2;
/// In a Markdown file, the line after which the tables go.
const TABLE_MARK: &str = "<!-- table -->";
/// Off a terminal, progress is said this often.
const SAY_EVERY: Duration = Duration::from_secs(15);

/// Runs the same task under every scheme over every line, on virtual time, and prints the table of what it came to.
#[derive(Parser)]
#[command(name = "teleclay-latency", version)]
struct Arguments {
    /// Few cells and few seeds: under a minute
    #[arg(long)]
    quick: bool,
    /// Write everything as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the tables as Markdown; in a file with a line `<!-- table -->` what stands before that line stays
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write the page's few tables as Markdown, likewise
    #[arg(long, value_name = "FILE")]
    summary: Option<PathBuf>,
    /// Write heatmaps as SVG into this folder
    #[arg(long, value_name = "DIR")]
    svg: Option<PathBuf>,
    /// Only this scheme; may be given several times
    #[arg(long, value_name = "SCHEME")]
    scheme: Vec<String>,
    /// How many seeds a cell gets [default: 30, with --quick 2]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: Option<u64>,
    /// The first seed
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    first_seed: u64,
    /// Only cells with this one-way delay, ms
    #[arg(long, value_name = "MS")]
    delay_ms: Option<u32>,
    /// Only cells with this jitter, over the delay
    #[arg(long, value_name = "RATIO")]
    jitter: Option<f64>,
    /// Only cells with this share of frames lost
    #[arg(long, value_name = "SHARE")]
    loss: Option<f64>,
    /// Only cells with this profile: iid, bursts, outage, second_writer
    #[arg(long, value_name = "PROFILE", value_parser = profile)]
    profile: Option<Profile>,
    /// Run nothing: take a table that `--json` wrote, and write it as Markdown, as heatmaps or shortened
    #[arg(long, value_name = "FILE", conflicts_with_all = ["quick", "seeds", "first_seed", "no_wall", "threads"])]
    from: Option<PathBuf>,
    /// Leave out the naive walls
    #[arg(long)]
    no_wall: bool,
    /// Threads that work [default: as many as there are cores]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

/// Reads the arguments of this process and does what they say, with `own` as further columns of the table.
pub fn main(own: &[&'static dyn OwnScheme]) -> ExitCode {
    match run(&Arguments::parse(), own) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Whoever closed stderr does not want to know.
            let _ = writeln!(std::io::stderr(), "teleclay-latency: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments, own: &[&'static dyn OwnScheme]) -> anyhow::Result<()> {
    let laws = laws(own)?;
    arguments.check_schemes(&laws)?;
    let files = [&arguments.json, &arguments.markdown, &arguments.summary];
    for file in files.into_iter().flatten() {
        check_writable(file)?;
    }
    let table = match &arguments.from {
        Some(file) => read(file, arguments)?,
        None => measure(arguments, &laws)?,
    };
    let tables = markdown(&table.wall, &table.cells);
    match &arguments.markdown {
        Some(file) => write_below_mark(file, &tables)?,
        None if arguments.summary.is_some() => {}
        None => write_out(&tables)?,
    }
    if let Some(file) = &arguments.summary {
        let range_n = LoopParameters::default().force_limit_n;
        write_below_mark(file, &summary(&table.wall, &table.cells, range_n))?;
    }
    if let Some(file) = &arguments.json {
        write(file, table.to_json()?.as_bytes())?;
    }
    if let Some(folder) = &arguments.svg {
        write_heatmaps(folder, &table.cells)?;
    }
    Ok(())
}

/// What may couple hand and tool: the schemes that sessions have, then one's own.
fn laws(own: &[&'static dyn OwnScheme]) -> anyhow::Result<Vec<Law>> {
    let mut laws: Vec<Law> = SCHEMES.into_iter().map(Law::from).collect();
    for own in own.iter().map(|own| Law::Own(*own)) {
        ensure!(!laws.contains(&own), "two schemes are called {own}");
        laws.push(own);
    }
    Ok(laws)
}

/// Runs the cells that were asked for.
fn measure(arguments: &Arguments, laws: &[Law]) -> anyhow::Result<Document> {
    let extent = if arguments.quick {
        Extent::Quick
    } else {
        Extent::Full
    };
    let wanted: Vec<Cell> = laws
        .iter()
        .flat_map(|law| cells_of(*law, extent))
        .filter(|cell| arguments.wants(cell.scheme.word(), &Line::of(cell)))
        .collect();
    ensure!(
        !wanted.is_empty(),
        "no cell of the table has what was asked for"
    );
    let seeds = arguments.seeds.unwrap_or(if arguments.quick {
        QUICK_SEEDS
    } else {
        FULL_SEEDS
    });
    let threads = arguments.threads.map_or_else(
        || std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        usize::from,
    );
    let walls = if arguments.no_wall { 0 } else { wall::WALLS };
    let work = Work::new(wanted, arguments.first_seed, seeds, walls);
    let (wall, cells) = work.carry_out(threads)?;
    Ok(Document { wall, cells })
}

/// The rows of a table written before.
fn read(file: &Path, arguments: &Arguments) -> anyhow::Result<Document> {
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let mut table = Document::from_json(&text)
        .with_context(|| format!("{} is no latency table", file.display()))?;
    table.cells.retain(|row| {
        let line = Line {
            delay_ms: (row.one_way_delay_s * 1e3).round() as u32,
            jitter_ratio: row.jitter_ratio,
            loss: row.loss,
            profile: row.profile,
        };
        arguments.wants(&row.scheme, &line)
    });
    ensure!(
        !table.cells.is_empty(),
        "no cell of the table has what was asked for"
    );
    Ok(table)
}

/// What a cell or a row does to the line.
struct Line {
    delay_ms: u32,
    jitter_ratio: f64,
    loss: f64,
    profile: Profile,
}

impl Line {
    fn of(cell: &Cell) -> Self {
        Self {
            delay_ms: cell.delay_ms,
            jitter_ratio: cell.jitter_ratio,
            loss: cell.loss,
            profile: cell.profile,
        }
    }
}

impl Arguments {
    fn check_schemes(&self, laws: &[Law]) -> anyhow::Result<()> {
        let words: Vec<&str> = laws.iter().map(|law| law.word()).collect();
        for got in &self.scheme {
            ensure!(
                words.contains(&got.as_str()),
                "--scheme {got}: wanted one of {}",
                words.join(", ")
            );
        }
        Ok(())
    }

    fn wants(&self, scheme: &str, line: &Line) -> bool {
        let is_near =
            |wish: Option<f64>, value: f64| wish.is_none_or(|wish| (wish - value).abs() < 1e-9);
        (self.scheme.is_empty() || self.scheme.iter().any(|wanted| wanted == scheme))
            && self
                .delay_ms
                .is_none_or(|delay_ms| delay_ms == line.delay_ms)
            && is_near(self.jitter, line.jitter_ratio)
            && is_near(self.loss, line.loss)
            && self.profile.is_none_or(|profile| profile == line.profile)
    }
}

fn profile(word: &str) -> Result<Profile, String> {
    let known = Profile::ALL
        .into_iter()
        .find(|profile| profile.word() == word);
    known.ok_or_else(|| {
        let words = Profile::ALL.map(Profile::word).join(", ");
        format!("`{word}` is not a profile, have {words}")
    })
}

/// One piece of work.
#[derive(Clone, Copy)]
enum Piece {
    Wall(usize),
    /// A cell's number and a seed; the reference is made along with it.
    Run {
        cell: usize,
        seed: u64,
    },
}

struct Work {
    cells: Vec<Cell>,
    first_seed: u64,
    seeds: u64,
    walls: usize,
}

impl Work {
    fn new(cells: Vec<Cell>, first_seed: u64, seeds: u64, walls: usize) -> Self {
        Self {
            cells,
            first_seed,
            seeds,
            walls,
        }
    }

    /// Runs that share a reference stand together, so that it is made once.
    fn pieces(&self) -> Vec<Vec<Piece>> {
        let mut groups: Vec<Vec<Piece>> = (0..self.walls)
            .map(|wall| vec![Piece::Wall(wall)])
            .collect();
        for seed in self.first_seed..self.first_seed + self.seeds {
            let mut of_reference: Vec<(Cell, Vec<Piece>)> = Vec::new();
            for (number, cell) in self.cells.iter().enumerate() {
                let reference = cell.reference();
                let piece = Piece::Run { cell: number, seed };
                match of_reference
                    .iter_mut()
                    .find(|(known, _)| *known == reference)
                {
                    Some((_, pieces)) => pieces.push(piece),
                    None => of_reference.push((reference, vec![piece])),
                }
            }
            groups.extend(of_reference.into_iter().map(|(_, pieces)| pieces));
        }
        groups
    }

    fn carry_out(&self, threads: usize) -> anyhow::Result<(Vec<WallRow>, Vec<Row>)> {
        let groups = self.pieces();
        let total: usize = groups.iter().map(Vec::len).sum();
        let progress = Progress::start(total);
        let next = AtomicUsize::new(0);
        let walls = Mutex::new(vec![None; self.walls]);
        let outcomes = Mutex::new(vec![vec![None; self.seeds as usize]; self.cells.len()]);
        std::thread::scope(|scope| -> anyhow::Result<()> {
            let workers: Vec<_> = (0..threads)
                .map(|_| {
                    scope.spawn(|| -> anyhow::Result<()> {
                        while let Some(group) = groups.get(next.fetch_add(1, Ordering::Relaxed)) {
                            self.carry_out_group(group, &walls, &outcomes, &progress)?;
                        }
                        Ok(())
                    })
                })
                .collect();
            for worker in workers {
                match worker.join() {
                    Ok(done) => done?,
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            Ok(())
        })?;
        progress.finish();
        let walls: Option<Vec<WallRow>> = walls.into_inner().expect(DONE).into_iter().collect();
        let mut rows = Vec::with_capacity(self.cells.len());
        for (cell, outcomes) in self.cells.iter().zip(outcomes.into_inner().expect(DONE)) {
            let outcomes: Option<Vec<Outcome>> = outcomes.into_iter().collect();
            rows.push(Row::of(cell, self.first_seed, &outcomes.expect(DONE)));
        }
        Ok((walls.expect(DONE), rows))
    }

    fn carry_out_group(
        &self,
        group: &[Piece],
        walls: &Mutex<Vec<Option<WallRow>>>,
        outcomes: &Mutex<Vec<Vec<Option<Outcome>>>>,
        progress: &Progress,
    ) -> anyhow::Result<()> {
        let mut reference = None;
        for piece in group {
            match *piece {
                Piece::Wall(number) => {
                    let row = wall::row(number);
                    walls.lock().expect(DONE)[number] = Some(row);
                    progress.advance("naive wall");
                }
                Piece::Run { cell: number, seed } => {
                    let cell = &self.cells[number];
                    let track = match reference.take() {
                        Some(track) => track,
                        None => run::reference(cell, seed)?,
                    };
                    let outcome = run::run(cell, seed, &track)?;
                    reference = Some(track);
                    let place = (seed - self.first_seed) as usize;
                    outcomes.lock().expect(DONE)[number][place] = Some(outcome);
                    progress.advance(cell.scheme.word());
                }
            }
        }
        Ok(())
    }
}

const DONE: &str = "a worker that panics ends the program, and every piece is worked on";

/// A line that moves on a terminal, a word now and then elsewhere. On stderr: the table goes to stdout.
struct Progress {
    bar: ProgressBar,
    total: usize,
    said: Option<Mutex<(usize, Instant)>>,
}

impl Progress {
    fn start(total: usize) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let target = if is_terminal {
            ProgressDrawTarget::stderr_with_hz(10)
        } else {
            ProgressDrawTarget::hidden()
        };
        let style = ProgressStyle::with_template(
            "{bar:30} {pos}/{len} runs, {elapsed}, {eta} to go, {msg}",
        )
        .expect("the template is right");
        let bar = ProgressBar::with_draw_target(Some(total as u64), target).with_style(style);
        Self {
            bar,
            total,
            said: (!is_terminal).then(|| Mutex::new((0, Instant::now()))),
        }
    }

    fn advance(&self, what: &'static str) {
        self.bar.set_message(what);
        self.bar.inc(1);
        let Some(said) = &self.said else { return };
        let (done, last) = &mut *said.lock().expect(DONE);
        *done += 1;
        if SAY_EVERY <= last.elapsed() {
            *last = Instant::now();
            // Whoever closed stderr does not want to know.
            let _ = writeln!(std::io::stderr(), "{done} of {} runs, {what}", self.total);
        }
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn write_heatmaps(folder: &Path, rows: &[Row]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for measure in &Measure::ALL {
        for (word, jitter_ratio) in [("steady", 0.0), ("jitter", 0.5)] {
            if let Some(svg) = heatmap(rows, measure, jitter_ratio) {
                let file = folder.join(format!("{}-{word}.svg", measure.name));
                write(&file, svg.as_bytes())?;
            }
        }
    }
    Ok(())
}

/// Found out before an hour of work, not after it.
fn check_writable(file: &Path) -> anyhow::Result<()> {
    std::fs::OpenOptions::new()
        .append(true)
        .create(true)
        .open(file)
        .map(drop)
        .with_context(|| format!("cannot write {}", file.display()))
}

fn write(file: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(file, bytes).with_context(|| format!("cannot write {}", file.display()))
}

/// What stands in the file before the mark stays.
fn write_below_mark(file: &Path, tables: &str) -> anyhow::Result<()> {
    let before = std::fs::read_to_string(file).unwrap_or_default();
    let head = before.split_once(TABLE_MARK).map(|(head, _)| head);
    let head = head.map_or_else(String::new, |head| format!("{head}{TABLE_MARK}\n\n"));
    write(file, format!("{head}{tables}").as_bytes())
}

fn write_out(text: &str) -> anyhow::Result<()> {
    let written = std::io::stdout().write_all(text.as_bytes());
    match written {
        // `| head` is enough for some.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to stdout"),
    }
}
