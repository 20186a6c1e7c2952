//! Tables for people: every cell, failures too.

use std::fmt::Write;

use super::{distinct, of_scheme, percent, schemes};
use crate::cell::Profile;
use crate::table::Row;
use crate::wall::WallRow;

/// What a table of the grid shows of a row.
struct Column {
    title: &'static str,
    explains: &'static str,
    show: fn(&Row) -> String,
}

const COLUMNS: [Column; 6] = [
    Column {
        title: "Force error",
        explains: "root mean square of the force error over that of the force without a network, %; **u** marks a loop that swings more than twice as much as without a network",
        show: |row| percent(row.force_nrmse),
    },
    Column {
        title: "Removed volume",
        explains: "off by this share of what is removed without a network, %",
        show: |row| percent(row.removed_volume_error),
    },
    Column {
        title: "Coordination",
        explains: "root mean square of the distance between tool and image of the handle, mm",
        show: |row| format!("{:.2}", row.coordination_rmse_m * 1e3),
    },
    Column {
        title: "Time with a force error that a hand could tell",
        explains: "share of time with more than 7 % (or 0.02 N), %",
        show: |row| percent(row.share_force_error_above_jnd),
    },
    Column {
        title: "Least energy of the channel",
        explains: "of any seed, mJ; below zero the channel gave what nobody had put in",
        show: |row| format!("{:.3}", row.min_energy_j * 1e3),
    },
    Column {
        title: "Traffic",
        explains: "both ways together, kB/s without what transports add",
        show: |row| format!("{:.0}", row.bytes_per_s * 1e-3),
    },
];

/// Everything, as Markdown without a heading of its own.
pub fn markdown(walls: &[WallRow], rows: &[Row]) -> String {
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = write_walls(&mut text, walls);
    for scheme in schemes(rows) {
        let _ = write_scheme(&mut text, rows, scheme);
    }
    let _ = write_profiles(&mut text, rows);
    text
}

fn write_walls(text: &mut String, walls: &[WallRow]) -> std::fmt::Result {
    if walls.is_empty() {
        return Ok(());
    }
    writeln!(text, "## The naive wall\n")?;
    writeln!(
        text,
        "| mass, kg | damping, N·s/m | round trip, ms | theory, N/m | measured, N/m | off by |"
    )?;
    writeln!(text, "|---:|---:|---:|---:|---:|---:|")?;
    for wall in walls {
        let off = wall.measured_stiffness_n_per_m / wall.critical_stiffness_n_per_m - 1.0;
        writeln!(
            text,
            "| {} | {} | {:.0} | {:.2} | {:.2} | {:+.3} % |",
            wall.mass_kg,
            wall.damping_n_s_per_m,
            wall.rtt_s * 1e3,
            wall.critical_stiffness_n_per_m,
            wall.measured_stiffness_n_per_m,
            off * 100.0
        )?;
    }
    writeln!(text)
}

fn write_scheme(text: &mut String, rows: &[Row], scheme: &str) -> std::fmt::Result {
    let grid: Vec<&Row> = of_scheme(rows, scheme).collect();
    if grid.is_empty() {
        return Ok(());
    }
    writeln!(text, "## `{scheme}`\n")?;
    let losses = distinct(grid.iter().map(|row| row.loss));
    for Column {
        title,
        explains,
        show,
    } in COLUMNS
    {
        writeln!(text, "### {title} of `{scheme}`\n")?;
        writeln!(text, "{explains}.\n")?;
        write!(text, "| one way, ms | jitter |")?;
        for loss in &losses {
            write!(text, " {:.0} % lost |", loss * 100.0)?;
        }
        writeln!(text, "\n|---:|---:|{}", "---:|".repeat(losses.len()))?;
        for delay_s in distinct(grid.iter().map(|row| row.one_way_delay_s)) {
            for jitter in distinct(grid.iter().map(|row| row.jitter_ratio)) {
                let line = |loss: f64| {
                    grid.iter().find(|row| {
                        same(row.one_way_delay_s, delay_s)
                            && same(row.jitter_ratio, jitter)
                            && same(row.loss, loss)
                    })
                };
                if losses.iter().all(|loss| line(*loss).is_none()) {
                    continue;
                }
                write!(text, "| {:.0} | {jitter} |", delay_s * 1e3)?;
                for loss in &losses {
                    match line(*loss) {
                        Some(row) => write!(text, " {}{} |", show(row), mark(row))?,
                        None => write!(text, " |")?,
                    }
                }
                writeln!(text)?;
            }
        }
        writeln!(text)?;
    }
    Ok(())
}

fn write_profiles(text: &mut String, rows: &[Row]) -> std::fmt::Result {
    let special: Vec<&Row> = rows
        .iter()
        .filter(|row| row.profile != Profile::Iid)
        .collect();
    if special.is_empty() {
        return Ok(());
    }
    writeln!(text, "## Bursts, an outage, a second writer\n")?;
    writeln!(
        text,
        "Force error, volume and coordination as above. Steps are changes of the felt force by corrections, N a tick. What is hidden is \
         the felt force less the authority's answer to the same sweep, over the felt force. Earned is the most energy that \
         the hand spent on cutting in any seed, injected the most that corrections brought into it.\n"
    )?;
    writeln!(
        text,
        "| line | scheme | one way, ms | force error, % | volume off by, % | apart, mm | least energy, mJ | step p50 | p95 | p99 | max | earned, mJ | injected, mJ | hidden, % | clay the same |"
    )?;
    writeln!(
        text,
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|"
    )?;
    for row in special {
        let steps = row.correction_step_n;
        writeln!(
            text,
            "| {} | {} | {:.0} | {}{} | {} | {:.2} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.0} | {:.3} | {} | {} |",
            row.profile.word(),
            row.scheme,
            row.one_way_delay_s * 1e3,
            percent(row.force_nrmse),
            mark(row),
            percent(row.removed_volume_error),
            row.coordination_rmse_m * 1e3,
            row.min_energy_j * 1e3,
            steps.p50,
            steps.p95,
            steps.p99,
            steps.max,
            row.earned_j * 1e3,
            row.injected_j * 1e3,
            row.hidden_force_nrmse
                .map_or_else(|| "–".to_owned(), percent),
            match row.clay_identical {
                None => "–",
                Some(true) => "yes",
                Some(false) => "**no**",
            }
        )?;
    }
    writeln!(text)
}

fn mark(row: &Row) -> &'static str {
    if row.stable { "" } else { " **u**" }
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}
