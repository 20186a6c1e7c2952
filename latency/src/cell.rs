//! The cells of the table.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use teleclay_link::conditioner::{Bursts, Impairment, Outages};
use teleclay_proto::Scheme;
use teleclay_session::Lines;

use crate::law::Law;

/// Every scheme that sessions have, in the order in which they are shown.
pub const SCHEMES: [Scheme; 5] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
    Scheme::Replica,
];
/// One-way delays, ms.
pub const DELAYS_MS: [u32; 9] = [0, 1, 2, 5, 10, 25, 50, 100, 250];
/// Standard deviation of the one-way delay over its mean.
pub const JITTER_RATIOS: [f64; 3] = [0.0, 0.2, 0.5];
/// Shares of frames lost, independently.
pub const LOSSES: [f64; 5] = [0.0, 0.01, 0.05, 0.1, 0.3];
/// Jitter beside the special lines.
const PROFILE_JITTER_RATIO: f64 = 0.2;

/// Runs of ten lost frames on average, an eleventh of all frames.
const BURSTS: Bursts = Bursts {
    enter: 0.01,
    leave: 0.1,
    loss: 1.0,
};
/// The line is cut for 200 ms from 4 s on, in the middle of the task.
const OUTAGE: Outages = Outages {
    every: OUTAGE_OVER,
    length: Duration::from_millis(200),
};
/// Then it stays as it is: one cut is asked for, the conditioner makes them periodically.
pub const OUTAGE_OVER: Duration = Duration::from_millis(4200);

/// What is done to the line or to the clay beside delay, jitter and independent loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// Nothing more is done: delay, jitter and loss are independent from frame to frame.
    Iid,
    /// Frames are lost in bursts.
    Bursts,
    /// The line is cut for 200 ms.
    Outage,
    /// Another operator cuts the same clay.
    SecondWriter,
}

impl Profile {
    /// Every profile.
    pub const ALL: [Self; 4] = [Self::Iid, Self::Bursts, Self::Outage, Self::SecondWriter];

    /// The word for it in arguments and files.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Iid => "iid",
            Self::Bursts => "bursts",
            Self::Outage => "outage",
            Self::SecondWriter => "second_writer",
        }
    }
}

/// One cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// What couples hand and tool.
    pub scheme: Law,
    /// Mean one-way delay, ms.
    pub delay_ms: u32,
    /// Standard deviation of the one-way delay over its mean.
    pub jitter_ratio: f64,
    /// Share of frames lost, independently.
    pub loss: f64,
    /// What else.
    pub profile: Profile,
}

impl Cell {
    /// The cell that this one is measured against: the same without a network.
    pub fn reference(&self) -> Self {
        Self {
            delay_ms: 0,
            jitter_ratio: 0.0,
            loss: 0.0,
            profile: match self.profile {
                Profile::SecondWriter => Profile::SecondWriter,
                _ => Profile::Iid,
            },
            ..*self
        }
    }

    /// What the line does, both ways alike but each with chances of its own.
    pub fn lines(&self, seed: u64) -> Lines {
        let delay = Duration::from_millis(self.delay_ms.into());
        let line = Impairment {
            delay,
            jitter: delay.mul_f64(self.jitter_ratio),
            loss: self.loss,
            bursts: (self.profile == Profile::Bursts).then_some(BURSTS),
            outages: (self.profile == Profile::Outage).then_some(OUTAGE),
            ..Impairment::default()
        };
        Lines {
            up: line,
            up_seed: 2 * seed,
            down: line,
            down_seed: 2 * seed + 1,
        }
    }
}

impl Cell {
    /// The line once the outage is over.
    pub fn lines_after_outage(&self, seed: u64) -> Lines {
        let mut lines = self.lines(seed);
        lines.up.outages = None;
        lines.down.outages = None;
        lines
    }
}

/// Which cells are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Every cell.
    Full,
    /// Few of them, for every day.
    Quick,
}

/// The cells of the schemes that sessions have, those of one scheme together.
pub fn cells(extent: Extent) -> Vec<Cell> {
    SCHEMES
        .into_iter()
        .flat_map(|scheme| cells_of(scheme.into(), extent))
        .collect()
}

/// The cells of one scheme.
pub fn cells_of(scheme: Law, extent: Extent) -> Vec<Cell> {
    let cell = |delay_ms, jitter_ratio, loss, profile| Cell {
        scheme,
        delay_ms,
        jitter_ratio,
        loss,
        profile,
    };
    let mut cells = Vec::new();
    match extent {
        Extent::Full => {
            for delay_ms in DELAYS_MS {
                for jitter_ratio in JITTER_RATIOS {
                    for loss in LOSSES {
                        cells.push(cell(delay_ms, jitter_ratio, loss, Profile::Iid));
                    }
                }
            }
        }
        Extent::Quick => {
            for delay_ms in [0, 5, 25, 100, 250] {
                for (jitter_ratio, loss) in [(0.0, 0.0), (0.5, 0.3)] {
                    cells.push(cell(delay_ms, jitter_ratio, loss, Profile::Iid));
                }
            }
        }
    }
    let (profile_delays, own): (&[u32], &[Profile]) = match extent {
        Extent::Full => (&DELAYS_MS, &Profile::ALL),
        Extent::Quick => (&[25, 250], &Profile::ALL),
    };
    for profile in own.iter().skip(1) {
        // Other schemes keep one clay: there a second writer is one more force, not a difference.
        if *profile == Profile::SecondWriter && !scheme.keeps_a_copy() {
            continue;
        }
        for &delay_ms in profile_delays {
            cells.push(cell(delay_ms, PROFILE_JITTER_RATIO, 0.0, *profile));
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_full_table_has_every_combination_once() {
        let all = cells(Extent::Full);
        assert_eq!(all.len(), 5 * (9 * 3 * 5 + 2 * 9) + 9);
        for (number, cell) in all.iter().enumerate() {
            assert!(!all[..number].contains(cell), "{cell:?} twice");
        }
    }

    #[test]
    fn a_reference_has_no_network() {
        for cell in cells(Extent::Full) {
            let Lines { up, down, .. } = cell.reference().lines(1);
            assert_eq!([up, down], [Impairment::default(); 2]);
        }
    }
}
