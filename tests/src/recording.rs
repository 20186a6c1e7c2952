//! What a handle wrote down with `--record`, tick by tick.

use anyhow::{Context as _, Result, ensure};

/// One tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// On the handle's clock, s.
    pub clock_s: f64,
    /// How long after its deadline the tick started, s.
    pub lateness_s: f64,
    /// The lease.
    pub lease: u32,
    /// Who moved the handle: `coupled`, `braking`, `resting`.
    pub mode: String,
    /// What was felt, and why not: `live`, `not_yet`, `silent`, `paused`, `fault`.
    pub link_state: String,
    /// What the copy of the clay was good for: `none`, `live`, `stale`, `diverged`.
    pub copy: String,
    /// The block that the copy was of.
    pub clay_epoch: u32,
    /// Since the last frame of the tool side, s.
    pub silence_s: f64,
    /// Round trip, when a frame of this tick completed one, s.
    pub rtt_s: Option<f64>,
    /// Displacement of the handle from home, m.
    pub position_m: [f64; 3],
    /// Force of the hand at the sensor, N.
    pub hand_force_n: [f64; 3],
    /// Force on the hand, N.
    pub felt_force_n: [f64; 3],
    /// How far corrections of the copy have moved that force so far, N.
    pub correction_moved_n: f64,
}

impl Row {
    /// Magnitude of the force on the hand, N.
    pub fn felt_n(&self) -> f64 {
        norm(self.felt_force_n)
    }
}

/// Reads a recording; a last line that is still being written is left out.
///
/// # Errors
/// Its columns are others, or a value is none.
pub fn read(text: &str) -> Result<Vec<Row>> {
    let Some(end) = text.rfind('\n') else {
        return Ok(Vec::new());
    };
    let mut lines = text[..end].lines();
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    lines
        .enumerate()
        .map(|(index, line)| row(&columns, line).with_context(|| format!("tick {index}: {line}")))
        .collect()
}

fn row(columns: &[&str], line: &str) -> Result<Row> {
    let values: Vec<&str> = line.split(',').collect();
    ensure!(
        values.len() == columns.len(),
        "{} values, {} columns",
        values.len(),
        columns.len()
    );
    let text = |column: &str| {
        let index = columns.iter().position(|name| *name == column);
        index
            .map(|index| values[index])
            .with_context(|| format!("no column {column}"))
    };
    let number = |column: &str| -> Result<f64> { Ok(text(column)?.parse()?) };
    let vector = |start: &str, end: &str| -> Result<[f64; 3]> {
        let axis = |name| number(&format!("{start}_{name}_{end}"));
        Ok([axis("x")?, axis("y")?, axis("z")?])
    };
    Ok(Row {
        clock_s: number("clock_s")?,
        lateness_s: number("lateness_s")?,
        lease: text("lease")?.parse()?,
        mode: text("mode")?.to_owned(),
        link_state: text("link_state")?.to_owned(),
        copy: text("copy")?.to_owned(),
        clay_epoch: text("clay_epoch")?.parse()?,
        silence_s: number("silence_s")?,
        rtt_s: match text("rtt_s")? {
            "" => None,
            value => Some(value.parse()?),
        },
        position_m: vector("position", "m")?,
        hand_force_n: vector("hand_force", "n")?,
        felt_force_n: vector("felt_force", "n")?,
        correction_moved_n: number("correction_moved_n")?,
    })
}

/// Length of a vector.
pub fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Greatest change of the force on the hand from tick to tick, N.
pub fn greatest_force_step_n(rows: &[Row]) -> f64 {
    rows.windows(2)
        .map(|pair| {
            let (a, b) = (pair[0].felt_force_n, pair[1].felt_force_n);
            norm(std::array::from_fn(|axis| b[axis] - a[axis]))
        })
        .fold(0.0, f64::max)
}

/// The `share`-quantile of the round trips, s; `None` without any.
pub fn rtt_quantile_s(rows: &[Row], share: f64) -> Option<f64> {
    let mut times: Vec<f64> = rows.iter().filter_map(|row| row.rtt_s).collect();
    times.sort_by(f64::total_cmp);
    let index = ((times.len() as f64 * share) as usize).min(times.len().checked_sub(1)?);
    Some(times[index])
}
