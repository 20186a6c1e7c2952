//! The table on one page: what had to come out and what did, and for each measure a line a delay with all schemes side
//! by side.

use std::fmt::Write;

use super::{distinct, of_scheme, percent, schemes};
use crate::cell::Profile;
use crate::table::Row;
use crate::wall::WallRow;

/// A passive channel may seem to give this much by rounding, J.
const ROUNDING_J: f64 = 1e-6;
/// Wall and theory agree to this share.
const WALL_SHARE: f64 = 0.01;
/// A force error of this share is none.
const FORCE_SHARE: f64 = 0.01;
/// No correction may step the force by more than this share of its range in a tick.
const STEP_SHARE: f64 = 0.07;

/// One measure: a figure of a row, as it is written.
struct Measure {
    title: &'static str,
    explains: &'static str,
    show: fn(&Row) -> String,
}

const MEASURES: [Measure; 4] = [
    Measure {
        title: "Force error",
        explains: "Root mean square of the force error over that of the force without a network, %.",
        show: |row| percent(row.force_nrmse),
    },
    Measure {
        title: "Time with a force error that a hand could tell",
        explains: "Share of time with more than 7 % (or 0.02 N), %.",
        show: |row| percent(row.share_force_error_above_jnd),
    },
    Measure {
        title: "Removed volume",
        explains: "Off by this share of what is removed without a network, %.",
        show: |row| percent(row.removed_volume_error),
    },
    Measure {
        title: "Tool and handle apart",
        explains: "Root mean square, mm. The replica's figure is the server's tool, which nobody feels.",
        show: |row| format!("{:.2}", row.coordination_rmse_m * 1e3),
    },
];

/// The page's tables, as Markdown. `force_range_n` is the device's.
pub fn summary(walls: &[WallRow], rows: &[Row], force_range_n: f64) -> String {
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = write_claims(&mut text, walls, rows, force_range_n);
    for measure in &MEASURES {
        let _ = write_measure(&mut text, rows, measure);
    }
    let _ = write_costs(&mut text, rows);
    text
}

/// What had to come out, what did, and whether that is so.
fn write_claims(
    text: &mut String,
    walls: &[WallRow],
    rows: &[Row],
    force_range_n: f64,
) -> std::fmt::Result {
    writeln!(text, "## What had to come out\n")?;
    writeln!(text, "| claim | found | holds |\n|---|---|---|")?;
    let mut claim = |claim: &str, found: String, holds: bool| {
        let holds = if holds { "yes" } else { "**no**" };
        writeln!(text, "| {claim} | {found} | {holds} |")
    };
    if !walls.is_empty() {
        let off = walls
            .iter()
            .map(|wall| wall.measured_stiffness_n_per_m / wall.critical_stiffness_n_per_m - 1.0)
            .fold(0.0, |worst: f64, off| worst.max(off.abs()));
        claim(
            "the naive wall turns unstable within 1 % of theory",
            format!("off by {:.3} % at most, {} walls", off * 100.0, walls.len()),
            off < WALL_SHARE,
        )?;
    }
    for scheme in ["wave", "tdpa"] {
        let of: Vec<&Row> = rows.iter().filter(|row| row.scheme == scheme).collect();
        if of.is_empty() {
            continue;
        }
        let least_j = of.iter().map(|row| row.min_energy_j).fold(0.0, f64::min);
        claim(
            &format!("`{scheme}` gives nothing that it did not get, in any cell"),
            format!("least energy {least_j:.1e} J in {} cells", of.len()),
            -ROUNDING_J <= least_j,
        )?;
    }
    let alone: Vec<&Row> = rows
        .iter()
        .filter(|row| row.scheme == "replica" && row.profile != Profile::SecondWriter)
        .collect();
    if !alone.is_empty() {
        let worst = |value: fn(&Row) -> f64| alone.iter().map(|row| value(row)).fold(0.0, f64::max);
        let force = worst(|row| row.force_nrmse_worst);
        claim(
            "`replica`, one operator: force error at most 1 % in every cell",
            format!(
                "{} % in the worst seed of {} cells",
                percent(force),
                alone.len()
            ),
            force <= FORCE_SHARE,
        )?;
        let volume = worst(|row| row.removed_volume_error_worst);
        claim(
            "… and the removed volume is exact",
            format!("off by {} % at most", percent(volume)),
            volume <= 0.0,
        )?;
        let differing = alone
            .iter()
            .filter(|row| row.clay_identical != Some(true))
            .count();
        claim(
            "… and both sides' clay is one, bit for bit, once the line is drained",
            format!("it differs in {differing} cells"),
            differing == 0,
        )?;
    }
    let shared: Vec<&Row> = rows
        .iter()
        .filter(|row| row.profile == Profile::SecondWriter)
        .collect();
    if !shared.is_empty() {
        let step_n = shared
            .iter()
            .map(|row| row.correction_step_n.max)
            .fold(0.0, f64::max);
        claim(
            "`replica`, two operators: no correction steps the force by more than 7 % of its range in a tick",
            format!(
                "{step_n:.2} N, {:.1} % of {force_range_n:.0} N",
                100.0 * step_n / force_range_n
            ),
            step_n <= STEP_SHARE * force_range_n,
        )?;
        let injected = |row: &Row| row.injected_j / row.earned_j.max(f64::MIN_POSITIVE);
        let most = shared.iter().map(|row| injected(row)).fold(0.0, f64::max);
        claim(
            "… and corrections bring no energy that the hand had not spent on cutting before",
            format!("{} % of it at most", percent(most)),
            most <= 1.0,
        )?;
        let differing = shared
            .iter()
            .filter(|row| row.clay_identical != Some(true))
            .count();
        claim(
            "… and all copies are the server's clay, bit for bit, once the line is drained",
            format!("one differs in {differing} cells"),
            differing == 0,
        )?;
    }
    writeln!(text)
}

fn write_measure(text: &mut String, rows: &[Row], measure: &Measure) -> std::fmt::Result {
    let schemes: Vec<&str> = schemes(rows)
        .into_iter()
        .filter(|scheme| of_scheme(rows, scheme).next().is_some())
        .collect();
    let grid = || rows.iter().filter(|row| row.profile == Profile::Iid);
    let worst_jitter = grid().map(|row| row.jitter_ratio).fold(0.0, f64::max);
    let worst_loss = grid().map(|row| row.loss).fold(0.0, f64::max);
    writeln!(text, "## {}\n", measure.title)?;
    writeln!(
        text,
        "{} First on a steady line, then with jitter of {worst_jitter} of the delay and {:.0} % lost.\n",
        measure.explains,
        worst_loss * 100.0
    )?;
    write!(text, "| one way, ms |")?;
    for scheme in &schemes {
        write!(text, " `{scheme}` | |")?;
    }
    writeln!(text, "\n|---:|{}", "---:|---:|".repeat(schemes.len()))?;
    for delay_s in distinct(grid().map(|row| row.one_way_delay_s)) {
        write!(text, "| {:.0} |", delay_s * 1e3)?;
        for scheme in &schemes {
            for (jitter, loss) in [(0.0, 0.0), (worst_jitter, worst_loss)] {
                let row = of_scheme(rows, scheme).find(|row| {
                    [row.one_way_delay_s, row.jitter_ratio, row.loss].map(f64::to_bits)
                        == [delay_s, jitter, loss].map(f64::to_bits)
                });
                match row {
                    Some(row) if row.stable => write!(text, " {} |", (measure.show)(row))?,
                    Some(row) => write!(text, " {} **u** |", (measure.show)(row))?,
                    None => write!(text, " |")?,
                }
            }
        }
        writeln!(text)?;
    }
    writeln!(text)
}

/// Stability, energy and traffic, a line a scheme.
fn write_costs(text: &mut String, rows: &[Row]) -> std::fmt::Result {
    writeln!(text, "## Stability, energy and traffic\n")?;
    writeln!(
        text,
        "Over all cells with one operator. Traffic is both ways together, without what transports add.\n"
    )?;
    writeln!(
        text,
        "| scheme | cells with u in any seed | of | first at, one way | least energy, mJ | frames/s | kB/s on a steady line | kB/s at most |"
    )?;
    writeln!(text, "|---|---:|---:|---:|---:|---:|---:|---:|")?;
    for scheme in schemes(rows) {
        let of: Vec<&Row> = rows
            .iter()
            .filter(|row| row.scheme == scheme && row.profile != Profile::SecondWriter)
            .collect();
        if of.is_empty() {
            continue;
        }
        let unstable: Vec<&&Row> = of.iter().filter(|row| !row.stable).collect();
        let first_s = unstable
            .iter()
            .map(|row| row.one_way_delay_s)
            .reduce(f64::min);
        let steady = of.iter().find(|row| {
            row.profile == Profile::Iid && 0.0 < row.one_way_delay_s && row.loss <= 0.0
        });
        writeln!(
            text,
            "| `{scheme}` | {} | {} | {} | {:.3} | {:.0} | {:.0} | {:.0} |",
            unstable.len(),
            of.len(),
            first_s.map_or_else(|| "–".to_owned(), |s| format!("{:.0} ms", s * 1e3)),
            of.iter().map(|row| row.min_energy_j).fold(0.0, f64::min) * 1e3,
            of.iter().map(|row| row.packets_per_s).fold(0.0, f64::max),
            steady.map_or(f64::NAN, |row| row.bytes_per_s * 1e-3),
            of.iter().map(|row| row.bytes_per_s).fold(0.0, f64::max) * 1e-3
        )?;
    }
    writeln!(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::{Extent, cells};
    use crate::run::Outcome;

    fn rows(change: impl Fn(&mut Outcome)) -> Vec<Row> {
        let mut outcome = Outcome {
            stable: true,
            clay_identical: Some(true),
            earned_j: 1.0,
            ..Outcome::default()
        };
        change(&mut outcome);
        cells(Extent::Quick)
            .iter()
            .map(|cell| Row::of(cell, 1, std::slice::from_ref(&outcome)))
            .collect()
    }

    /// Every claim can fail, and says so.
    #[test]
    fn a_claim_that_does_not_hold_is_told() {
        type Change = fn(&mut Outcome);
        let broken = |change: Change| {
            let text = summary(&[], &rows(change), 20.0);
            text.matches("**no**").count()
        };
        assert_eq!(broken(|_| {}), 0);
        assert_eq!(broken(|outcome| outcome.min_energy_j = -2e-6), 2);
        assert_eq!(broken(|outcome| outcome.force_nrmse = 0.011), 1);
        assert_eq!(broken(|outcome| outcome.removed_volume_error = 1e-9), 1);
        assert_eq!(broken(|outcome| outcome.clay_identical = Some(false)), 2);
        assert_eq!(broken(|outcome| outcome.correction_steps_n = vec![1.5]), 1);
        assert_eq!(broken(|outcome| outcome.injected_j = 1.1), 1);
    }

    #[test]
    fn a_loop_that_swings_is_marked_in_every_table() {
        let text = summary(&[], &rows(|outcome| outcome.stable = false), 20.0);
        let marks = text.matches("**u**").count();
        // Five delays, five schemes, two lines.
        assert_eq!(marks, MEASURES.len() * 5 * 5 * 2);
    }
}
