//! `teleclay-server history`: looks into the history of a session that is kept, with or without a server at work there.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::Args;
use teleclay_clay::{Clay, Mesh, stl};
use teleclay_history::State;
use teleclay_keeping::archive::Depth;
use teleclay_keeping::{HomeError, PastError, Until, folder_of, look_back};
use teleclay_proto::SessionId;

use crate::doors::command::Folder;
use crate::engine::TICK;
use crate::session::tool_id;

/// Look into the history of a session: its strokes, its clay at any moment, whether its files are sound
#[derive(Clone, Debug, Args)]
pub struct HistoryCommand {
    /// The session
    session: SessionId,
    /// As it was at this moment, in seconds since the session began (default: now)
    #[arg(long, value_name = "T")]
    at_s: Option<f64>,
    /// Write the clay into this file, as STL in millimetres
    #[arg(long, value_name = "FILE")]
    stl: Option<PathBuf>,
    /// Replay everything from the first record that is kept, and compare each record and snapshot with it
    #[arg(long, conflicts_with = "at_s")]
    verify: bool,
    #[command(flatten)]
    folder: Folder,
}

impl HistoryCommand {
    /// Tells of the session.
    ///
    /// # Errors
    /// There is no such session, its files are damaged or differ from what they tell of, or something cannot be read or
    /// written.
    pub fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        let data = self.folder.path()?;
        let folder = folder_of(&data, &self.session);
        anyhow::ensure!(
            folder.is_dir(),
            "{} has no session `{}`",
            data.display(),
            self.session
        );
        let mut state = self
            .state(&folder)
            .with_context(|| format!("session {}", self.session))?;
        tell(&self.session, &mut state, out)?;
        if self.verify {
            writeln!(
                out,
                "every record and every snapshot agree with a replay from the first one"
            )?;
        }
        if let Some(path) = &self.stl {
            write_stl(path, &state.clay)?;
            writeln!(out, "wrote {}", path.display())?;
        }
        Ok(())
    }

    fn state(&self, folder: &Path) -> anyhow::Result<State> {
        if self.verify {
            return Ok(look_back(folder, Depth::All, |past| past.verify())?);
        }
        let Some(at_s) = self.at_s else {
            return Ok(look_back(folder, Depth::SinceSnapshot, |past| {
                past.state(Until::Now)
            })?);
        };
        anyhow::ensure!(
            0.0 <= at_s && at_s < 1e9,
            "--at-s {at_s}: want a moment from 0 to 1e9 s"
        );
        let tick = (at_s / TICK.as_secs_f64()).round() as u64;
        match look_back(folder, Depth::SinceSnapshot, |past| {
            past.state(Until::Tick(tick))
        }) {
            Err(HomeError::Past(PastError::NotKept)) => {
                anyhow::bail!("{at_s} s lies before everything that is kept")
            }
            other => Ok(other?),
        }
    }
}

fn tell(id: &SessionId, state: &mut State, out: &mut impl Write) -> anyhow::Result<()> {
    let tick_s = TICK.as_secs_f64();
    let unit_mm3 = state.clay.unit_volume_m3() * 1e9;
    writeln!(
        out,
        "stroke  tool  from_s      to_s        removed_mm3  operator"
    )?;
    for stroke in state.strokes.list() {
        writeln!(
            out,
            "{:<7} {:<5} {:<11.3} {:<11.3} {:<12.3} {}{}",
            stroke.number,
            tool_id(stroke.slot),
            stroke.from_tick as f64 * tick_s,
            stroke.to_tick as f64 * tick_s,
            stroke.removed_units as f64 * unit_mm3,
            stroke.operator,
            if stroke.is_undone { " (undone)" } else { "" },
        )?;
    }
    writeln!(
        out,
        "session {id} at {:.3} s: revision {}, block {}, hash {:016x}, {:.3} mm3 of clay",
        state.session.tick as f64 * tick_s,
        state.session.revision,
        state.session.clay_epoch,
        state.clay.hash(),
        state.clay.remaining_units() as f64 * unit_mm3,
    )?;
    Ok(())
}

fn write_stl(path: &Path, clay: &Clay) -> anyhow::Result<()> {
    let file = stl::encode(&Mesh::of(clay));
    std::fs::write(path, file).with_context(|| path.display().to_string())
}
