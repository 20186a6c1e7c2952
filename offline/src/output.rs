//! Tables: aligned for people, or as CSV (RFC 4180).

use std::io::{self, Write};

/// How an answer is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Table,
    Csv,
    Json,
}

/// Rows of cells under their headings.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Table {
    headings: Vec<String>,
    rows: Vec<Vec<Cell>>,
}

/// What a cell holds. Numbers are rounded for people and exact in CSV.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Cell {
    Number(f64),
    Count(usize),
    Text(String),
    Nothing,
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<Option<f64>> for Cell {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::Nothing, Self::Number)
    }
}

impl From<usize> for Cell {
    fn from(value: usize) -> Self {
        Self::Count(value)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl Table {
    /// A table with these columns and no rows.
    pub(crate) fn new<const N: usize>(headings: [&str; N]) -> Self {
        Self {
            headings: headings.map(str::to_owned).to_vec(),
            rows: Vec::new(),
        }
    }

    /// One more row.
    pub(crate) fn row<const N: usize>(&mut self, cells: [Cell; N]) {
        self.rows.push(cells.into());
    }

    /// Columns as wide as their widest cell; numbers to the right.
    pub(crate) fn write_aligned(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut lines = vec![self.headings.clone()];
        lines.extend(
            self.rows
                .iter()
                .map(|row| row.iter().map(Cell::rounded).collect()),
        );
        let width = |column: usize| {
            let widths = lines
                .iter()
                .map(|line: &Vec<String>| line[column].chars().count());
            widths.max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.headings.len()).map(width).collect();
        let to_the_right = |column: usize| {
            self.rows
                .iter()
                .all(|row| !matches!(row[column], Cell::Text(_)))
        };
        let sides: Vec<bool> = (0..self.headings.len()).map(to_the_right).collect();
        for line in &lines {
            let mut text = String::new();
            for (column, cell) in line.iter().enumerate() {
                let pad = " ".repeat(widths[column] - cell.chars().count());
                text.push_str("  ");
                text.push_str(&if sides[column] {
                    pad + cell
                } else {
                    cell.clone() + &pad
                });
            }
            writeln!(out, "{}", text.trim_end())?;
        }
        Ok(())
    }

    /// A header and a line a row, every digit kept.
    pub(crate) fn write_csv(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.headings.join(","))?;
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(Cell::exact).collect();
            writeln!(out, "{}", cells.join(","))?;
        }
        Ok(())
    }
}

impl Cell {
    fn rounded(&self) -> String {
        match self {
            Self::Number(value) => rounded(*value),
            Self::Count(count) => count.to_string(),
            Self::Text(text) => text.clone(),
            Self::Nothing => "-".to_owned(),
        }
    }

    fn exact(&self) -> String {
        match self {
            // Plus zero, so that no program meets a zero below zero.
            Self::Number(value) => (value + 0.0).to_string(),
            Self::Count(count) => count.to_string(),
            Self::Text(text) if text.contains([',', '"', '\n']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Self::Text(text) => text.clone(),
            Self::Nothing => String::new(),
        }
    }
}

/// Six significant digits, in powers of ten where the number is very large or very small.
pub(crate) fn rounded(value: f64) -> String {
    const DIGITS: i32 = 6;
    let magnitude = value.abs();
    if magnitude <= 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e7).contains(&magnitude) {
        return format!("{value:.5e}");
    }
    let before_the_point = magnitude.log10().floor() as i32 + 1;
    let places = usize::try_from(DIGITS - before_the_point).unwrap_or(0);
    let text = format!("{value:.places$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_six_digits_for_people_and_all_for_programs() {
        for (value, wanted) in [
            (0.0, "0"),
            (1.0 / 3.0, "0.333333"),
            (-2.0, "-2"),
            (1234.5678, "1234.57"),
            (123_456_789.0, "1.23457e8"),
            (1e-5, "1.00000e-5"),
            (0.06666666666666667, "0.0666667"),
        ] {
            assert_eq!(rounded(value), wanted);
        }
        assert_eq!(Cell::from(-0.0).exact(), "0");
        assert_eq!(Cell::from(1.0 / 3.0).exact().parse(), Ok(1.0 / 3.0));
    }

    #[test]
    fn columns_line_up_and_csv_quotes_what_needs_it() {
        let mut table = Table::new(["quantity", "value"]);
        table.row(["mass".into(), 1.5.into()]);
        table.row(["a, \"b\"".into(), None.into()]);
        let mut text = Vec::new();
        table.write_aligned(&mut text).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "  quantity  value\n  mass        1.5\n  a, \"b\"        -\n"
        );
        let mut text = Vec::new();
        table.write_csv(&mut text).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "quantity,value\nmass,1.5\n\"a, \"\"b\"\"\",\n"
        );
    }
}
