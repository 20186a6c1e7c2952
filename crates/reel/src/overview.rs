//! The least and greatest of each quantity along a whole recording, in memory that does not grow with its length: as it
//! goes on, columns are joined two by two.

use crate::scene::{QUANTITIES, Tool};

/// Columns of time that are kept: on a screen of two thousand pixels, four to each.
pub const COLUMNS: usize = 8192;
/// Of a column at first: a tick.
const LEAST_WIDTH_NS: u64 = 1_000_000;

/// The least and the greatest of what was told in a stretch of time; the first is above the second where nothing was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// The least.
    pub least: f32,
    /// The greatest.
    pub greatest: f32,
}

impl Extremes {
    /// Of nothing.
    pub const NONE: Self = Self {
        least: f32::INFINITY,
        greatest: f32::NEG_INFINITY,
    };

    fn join(&mut self, other: Self) {
        self.least = self.least.min(other.least);
        self.greatest = self.greatest.max(other.greatest);
    }
}

/// All tools of a recording, 2 MB each.
#[derive(Debug)]
pub struct Overview {
    from_ns: u64,
    width_ns: u64,
    /// By slot, quantity after quantity; nothing before a tool was shown.
    tools: Vec<Vec<Extremes>>,
}

impl Overview {
    /// Of a recording that begins then.
    pub(crate) const fn new(from_ns: u64) -> Self {
        Self {
            from_ns,
            width_ns: LEAST_WIDTH_NS,
            tools: Vec::new(),
        }
    }

    /// How long a column is, ns.
    #[must_use]
    pub const fn width_ns(&self) -> u64 {
        self.width_ns
    }

    /// Takes in what was told of a tool since the last tick.
    pub(crate) fn put(&mut self, slot: usize, time_ns: u64, tool: &Tool) {
        let after_ns = time_ns.saturating_sub(self.from_ns);
        while COLUMNS as u64 <= after_ns / self.width_ns {
            self.halve();
        }
        let column = (after_ns / self.width_ns) as usize;
        if self.tools.len() <= slot {
            self.tools.resize_with(slot + 1, Vec::new);
        }
        let columns = &mut self.tools[slot];
        columns.resize(QUANTITIES * COLUMNS, Extremes::NONE);
        for (quantity, value) in tool.values.iter().enumerate() {
            if tool.fresh & (1 << quantity) != 0 && !value.is_nan() {
                let value = *value as f32;
                columns[quantity * COLUMNS + column].join(Extremes {
                    least: value,
                    greatest: value,
                });
            }
        }
    }

    /// The extremes of a quantity between two moments, in so many columns of equal width.
    #[must_use]
    pub fn envelope(
        &self,
        slot: usize,
        quantity: usize,
        [from_ns, to_ns]: [u64; 2],
        count: usize,
    ) -> Vec<Extremes> {
        let mut found = vec![Extremes::NONE; count];
        let columns = self.tools.get(slot).map_or(&[][..], Vec::as_slice);
        let first = quantity * COLUMNS;
        let Some(columns) = columns.get(first..first + COLUMNS) else {
            return found;
        };
        let after = |ns: u64| ns.saturating_sub(self.from_ns);
        let span_ns = to_ns.saturating_sub(from_ns).max(1);
        let first = (after(from_ns) / self.width_ns) as usize;
        let last = (after(to_ns).div_ceil(self.width_ns) as usize).min(COLUMNS);
        for at in first..last.max(first) {
            // By its middle: no column of the overview counts twice.
            let middle_ns = self.from_ns + at as u64 * self.width_ns + self.width_ns / 2;
            let into = u128::from(middle_ns.saturating_sub(from_ns)) * count as u128;
            let into = (into / u128::from(span_ns)) as usize;
            if let (Some(column), Some(into)) = (columns.get(at), found.get_mut(into)) {
                into.join(*column);
            }
        }
        found
    }

    fn halve(&mut self) {
        self.width_ns *= 2;
        for columns in &mut self.tools {
            for row in columns.chunks_exact_mut(COLUMNS) {
                for at in 0..COLUMNS / 2 {
                    let mut joined = row[2 * at];
                    joined.join(row[2 * at + 1]);
                    row[at] = joined;
                }
                row[COLUMNS / 2..].fill(Extremes::NONE);
            }
        }
    }
}
