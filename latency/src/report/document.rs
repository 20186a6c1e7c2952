//! The table as JSON, for programs and for the dashboard: a wall or a cell a line.

use std::fmt::Write;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::table::Row;
use crate::wall::WallRow;

/// Digits that are written of a figure: more than anybody reads, and a third of the length of all of them.
const DIGITS: i32 = 6;

/// Everything that a run found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// The naive walls.
    pub wall: Vec<WallRow>,
    /// The cells.
    pub cells: Vec<Row>,
}

impl Document {
    /// As JSON, figures to six digits. What is not a number is `null`.
    ///
    /// # Errors
    /// Does not happen with these types; told rather than hidden.
    pub fn to_json(&self) -> serde_json::Result<String> {
        let mut text = String::from("{\n\"wall\": [\n");
        write_lines(&mut text, &self.wall)?;
        text.push_str("],\n\"cells\": [\n");
        write_lines(&mut text, &self.cells)?;
        text.push_str("]\n}\n");
        Ok(text)
    }

    /// From JSON.
    ///
    /// # Errors
    /// The text is no table.
    pub fn from_json(text: &str) -> serde_json::Result<Self> {
        serde_json::from_str(text)
    }
}

fn write_lines(text: &mut String, items: &[impl Serialize]) -> serde_json::Result<()> {
    for (number, item) in items.iter().enumerate() {
        let mut value = serde_json::to_value(item)?;
        shorten(&mut value);
        let comma = if number + 1 < items.len() { "," } else { "" };
        // Writing into a string does not fail.
        let _ = writeln!(text, "{value}{comma}");
    }
    Ok(())
}

fn shorten(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(shorten),
        Value::Object(fields) => fields.values_mut().for_each(shorten),
        Value::Number(number) if !(number.is_u64() || number.is_i64()) => {
            let shortened = number
                .as_f64()
                .map(rounded)
                .and_then(serde_json::Number::from_f64);
            if let Some(shortened) = shortened {
                *number = shortened;
            }
        }
        _ => {}
    }
}

/// The nearest number with [`DIGITS`] digits.
fn rounded(value: f64) -> f64 {
    let digits = (DIGITS - 1) as usize;
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::{Extent, cells};
    use crate::run::Outcome;

    #[test]
    fn a_table_comes_back_as_it_was_written_to_six_digits() {
        let outcome = Outcome {
            stable: true,
            min_energy_j: -1.234_567_89e-3,
            force_nrmse: 2.0 / 3.0,
            hidden_force_nrmse: Some(1e-9 / 3.0),
            correction_steps_n: vec![0.1, 0.2],
            clay_identical: Some(true),
            ..Outcome::default()
        };
        let all = cells(Extent::Quick);
        let table = Document {
            wall: vec![crate::wall::row(0)],
            cells: all
                .iter()
                .map(|cell| Row::of(cell, 1, std::slice::from_ref(&outcome)))
                .collect(),
        };
        let text = table.to_json().unwrap();
        let back = Document::from_json(&text).unwrap();
        assert_eq!(back.cells.len(), all.len());
        for (row, back) in table.cells.iter().zip(&back.cells) {
            assert_eq!((&row.scheme, row.profile), (&back.scheme, back.profile));
            assert!((back.min_energy_j + 1.234_57e-3).abs() < 1e-15);
            assert!((back.force_nrmse - row.force_nrmse).abs() < 1e-6);
        }
        // Once rounded, nothing changes any more.
        assert_eq!(back.to_json().unwrap(), text);
    }

    #[test]
    fn what_is_not_a_number_is_null_and_comes_back() {
        let outcome = Outcome {
            force_nrmse: f64::NAN,
            ..Outcome::default()
        };
        let cell = cells(Extent::Quick)[0];
        let table = Document {
            wall: Vec::new(),
            cells: vec![Row::of(&cell, 1, &[outcome])],
        };
        let text = table.to_json().unwrap();
        assert!(text.contains("\"force_nrmse\":null"), "{text}");
        assert!(
            Document::from_json(&text).unwrap().cells[0]
                .force_nrmse
                .is_nan()
        );
    }
}
