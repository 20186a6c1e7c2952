//! A row of the table, and how it is printed.
#![allow(clippy::print_stdout, reason = "the table is the program's output")]

use serde::Serialize;

/// One figure.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// Stable name.
    pub(crate) name: &'static str,
    /// Unit of all three numbers.
    pub(crate) unit: &'static str,
    /// What is aimed at; whether more or less is better shows in the name's last part.
    pub(crate) target: f64,
    /// What was measured.
    pub(crate) measured: f64,
    /// What the machine gives to a program that does nothing else, in the same run.
    pub(crate) floor: Option<f64>,
}

impl Row {
    pub(crate) fn new(name: &'static str, unit: &'static str, target: f64, measured: f64) -> Self {
        Self {
            name,
            unit,
            target,
            measured,
            floor: None,
        }
    }

    pub(crate) fn beside(mut self, floor: f64) -> Self {
        self.floor = Some(floor);
        self
    }

    fn is_reached(&self) -> bool {
        let more_is_better = self.unit == "x real time" || self.unit == "sessions";
        if more_is_better {
            self.target <= self.measured
        } else {
            self.measured <= self.target
        }
    }
}

pub(crate) fn heading(title: &str) {
    println!(
        "\n{title}\n  {:<34} {:>14} {:>14} {:>14}",
        "", "measured", "target", "floor"
    );
}

/// A line for whoever started this program.
pub(crate) fn say(words: &str) {
    println!("{words}");
}

pub(crate) fn print(row: &Row) {
    let mark = if row.is_reached() { " " } else { "!" };
    let floor = row
        .floor
        .map_or_else(|| "-".to_owned(), |floor| amount(floor, row.unit));
    println!(
        "{mark} {:<34} {:>14} {:>14} {:>14}",
        row.name,
        amount(row.measured, row.unit),
        amount(row.target, row.unit),
        floor
    );
}

pub(crate) fn close(rows: &[Row], stolen: f64) {
    let missed: Vec<&str> = rows
        .iter()
        .filter(|row| !row.is_reached())
        .map(|row| row.name)
        .collect();
    println!(
        "\n{} of {} targets reached",
        rows.len() - missed.len(),
        rows.len()
    );
    if !missed.is_empty() {
        println!("missed: {}", missed.join(", "));
    }
    if 0.01 < stolen {
        println!(
            "the hypervisor took {:.1} % of the processor: the tails are its, take the run again",
            100.0 * stolen
        );
    }
}

pub(crate) fn complain(text: &str) {
    use std::io::Write as _;
    // Nothing can be done about a standard error that is closed.
    let _ = writeln!(std::io::stderr(), "{text}");
}

fn amount(value: f64, unit: &str) -> String {
    match unit {
        "s" if value < 1e-6 => format!("{:.1} ns", value * 1e9),
        "s" if value < 1e-3 => format!("{:.1} us", value * 1e6),
        "s" if value < 1.0 => format!("{:.3} ms", value * 1e3),
        "m" => format!("{value:.1e} m"),
        "1" => format!("{:.2} %", value * 100.0),
        _ => format!("{value:.0} {unit}"),
    }
}

/// The value below which a share `q` of the samples lies. Sorts them.
pub(crate) fn quantile(samples: &mut [u64], q: f64) -> f64 {
    samples.sort_unstable();
    let last = samples.len().saturating_sub(1);
    samples
        .get((q * last as f64).round() as usize)
        .map_or(f64::NAN, |&nanos| nanos as f64 * 1e-9)
}
