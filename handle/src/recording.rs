//! Every tick as a line of a file, for whoever wants to look at a run afterwards.
//!
//! The file is CSV with a header; the columns are [`COLUMNS`]. It is written by the thread that reads the tick's
//! records, never by the tick.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use teleclay_bilateral::LinkState;

use crate::engine::{Mode, Record};

/// The columns. Times are on the handle's own clock; `silence_s` is how long ago the last frame of the tool side came,
/// `echo_s` how long ago it last showed that it had heard something new; `rtt_s` is empty unless a frame of this tick
/// completed a round trip. The handle's position is its displacement from home. `copy` says what its copy of the clay
/// is good for, where the scheme keeps one, `clay_epoch` which block that copy is of, or else the one last heard of, 0
/// before any; `correction_moved_n` is how far corrections of that copy have moved the
/// felt force since it was made, `correction_held_n` what they have still to let in.
pub const COLUMNS: &str = "clock_s,lateness_s,lease,mode,link_state,copy,clay_epoch,silence_s,echo_s,rtt_s,\
    position_x_m,position_y_m,position_z_m,velocity_x_m_s,velocity_y_m_s,velocity_z_m_s,\
    hand_force_x_n,hand_force_y_n,hand_force_z_n,felt_force_x_n,felt_force_y_n,felt_force_z_n,\
    correction_moved_n,correction_held_n";

/// An open file.
#[derive(Debug)]
pub struct Recording {
    file: BufWriter<File>,
}

impl Recording {
    /// Makes the file, with its header, over whatever was there.
    ///
    /// # Errors
    /// It cannot be made or written.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "{COLUMNS}")?;
        Ok(Self { file })
    }

    /// Writes one tick.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn write(&mut self, record: &Record) -> io::Result<()> {
        write_line(&mut self.file, record)
    }

    /// Hands everything to the system, so that it survives the end of this process.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn write_line(file: &mut impl Write, record: &Record) -> io::Result<()> {
    let seconds = |nanos: u64| nanos as f64 * 1e-9;
    write!(
        file,
        "{:.6},{:.9},{},{},{},{},{},{:.6},{:.6},",
        seconds(record.at_ns),
        seconds(record.lateness_ns),
        record.lease,
        mode(record.mode),
        link_state(record.link_state),
        record.copy,
        record.clay_epoch,
        seconds(record.silence_ns),
        seconds(record.echo_age_ns),
    )?;
    if let Some(rtt_ns) = record.heard.rtt_ns {
        write!(file, "{:.9}", seconds(rtt_ns))?;
    }
    for vector in [
        &record.sample.position_m,
        &record.sample.velocity_m_s,
        &record.sample.hand_force_n,
        &record.felt_force_n,
    ] {
        for value in vector {
            // As short as it can be without losing a bit.
            write!(file, ",{value:?}")?;
        }
    }
    let [x, y, z] = record.corrections.held_n;
    writeln!(
        file,
        ",{:?},{:?}",
        record.corrections.moved_n,
        x.hypot(y).hypot(z)
    )
}

const fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Coupled => "coupled",
        Mode::Braking => "braking",
        Mode::Resting => "resting",
    }
}

const fn link_state(link_state: LinkState) -> &'static str {
    match link_state {
        LinkState::Live => "live",
        LinkState::NotYet => "not_yet",
        LinkState::Silent => "silent",
        LinkState::OnCopy => "on_copy",
        LinkState::OnStaleCopy => "on_stale_copy",
        LinkState::Gone => "gone",
        LinkState::Paused => "paused",
        LinkState::Fault => "fault",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::sample_record;

    #[test]
    fn a_line_has_a_value_for_every_column() {
        for rtt_ns in [None, Some(1_500_000)] {
            let mut record = sample_record();
            record.at_ns = 2_000_001_000;
            record.heard.rtt_ns = rtt_ns;
            record.clay_epoch = 3;
            record.felt_force_n = [0.1, -2.0, 0.0];
            record.corrections.moved_n = 1.5;
            record.corrections.held_n = [0.0, -0.75, 1.0];
            let mut line = Vec::new();
            write_line(&mut line, &record).unwrap();
            let line = String::from_utf8(line).unwrap();
            let values: Vec<&str> = line.trim_end().split(',').collect();
            assert_eq!(values.len(), COLUMNS.split(',').count(), "{line}");
            let of = |column: &str| {
                let index = COLUMNS.split(',').position(|name| name == column).unwrap();
                values[index]
            };
            assert_eq!(of("clock_s"), "2.000001");
            assert_eq!(
                of("rtt_s"),
                rtt_ns.map_or("", |_| "0.001500000"),
                "no sample is no zero"
            );
            assert_eq!((of("link_state"), of("mode")), ("live", "coupled"));
            assert_eq!(of("clay_epoch"), "3");
            assert_eq!(
                (of("felt_force_x_n"), of("felt_force_y_n")),
                ("0.1", "-2.0")
            );
            assert_eq!(
                (of("correction_moved_n"), of("correction_held_n")),
                ("1.5", "1.25")
            );
        }
    }
}
