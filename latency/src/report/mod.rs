//! The rows as JSON, as Markdown and as pictures.

mod document;
mod heatmap;
mod markdown;
mod summary;

pub use document::Document;
pub use heatmap::{Measure, heatmap};
pub use markdown::markdown;
pub use summary::summary;

use crate::cell::{Profile, SCHEMES};
use crate::table::Row;

/// The rows of the grid of one scheme, without the special lines.
fn of_scheme<'a>(rows: &'a [Row], scheme: &'a str) -> impl Iterator<Item = &'a Row> {
    rows.iter()
        .filter(move |row| row.scheme == scheme && row.profile == Profile::Iid)
}

/// The schemes that occur: those that sessions have, then others in the order of their rows.
fn schemes(rows: &[Row]) -> Vec<&str> {
    let mut words: Vec<&str> = SCHEMES.iter().map(|scheme| scheme.word()).collect();
    words.retain(|word| rows.iter().any(|row| row.scheme == *word));
    for row in rows {
        if !words.contains(&row.scheme.as_str()) {
            words.push(&row.scheme);
        }
    }
    words
}

/// Values that occur, in order, each once.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup_by(|a, b| a.to_bits() == b.to_bits());
    values
}

/// With as many digits as say something.
fn percent(share: f64) -> String {
    let percent = share * 100.0;
    if percent.abs() <= 0.0 {
        "0".to_owned()
    } else if percent < 0.1 {
        format!("{percent:.1e}")
    } else if percent < 10.0 {
        format!("{percent:.2}")
    } else {
        format!("{percent:.0}")
    }
}
