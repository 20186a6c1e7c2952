//! Clay without a stroke or with one again, for a session that goes on cutting meanwhile.

use std::sync::Arc;

use teleclay_clay::Clay;
use teleclay_history::{ReplayError, Strokes, Whose};
use teleclay_session::{Exchange, ExchangedClay, Settings};

use crate::archive::Archive;
use crate::error::HomeError;
use crate::past::{For, PastError, Told, Until};

/// What is wanted of a session's strokes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Without the last stroke: of the tool in this slot, or of any.
    Undo(Option<usize>),
    /// Without this stroke of the present block and all later ones.
    UndoSince(u64),
    /// With the stroke that was undone last: of the tool in this slot, or of any.
    Redo(Option<usize>),
}

/// Why it cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum RewriteError {
    /// There is no such stroke.
    #[error("there is nothing to {}", match wanted { Wanted::Redo(_) => "redo", _ => "undo" })]
    Nothing {
        /// What was wanted.
        wanted: Wanted,
    },
    /// The stroke is older than everything that is kept.
    #[error("stroke {stroke} is older than what is kept of the session's history")]
    NotKept {
        /// Its number.
        stroke: u64,
    },
    /// The clay was exchanged for another meanwhile: begin again.
    #[error("the clay was exchanged for another meanwhile")]
    Overtaken,
    /// The files.
    #[error(transparent)]
    Home(#[from] HomeError),
}

/// Clay that is being made for a session.
pub struct Rewrite {
    told: Told,
    exchanged: ExchangedClay,
}

impl Rewrite {
    /// Makes the clay as of what is on disk. Takes as long as the cuts since the stroke take to be made again: 5 us
    /// each.
    ///
    /// # Errors
    /// There is nothing of the sort, it is no longer kept, or the files cannot be read.
    pub fn begin(archive: &Archive, wanted: Wanted) -> Result<Self, RewriteError> {
        archive.look_back(|past| {
            let mut told = past.tell(For::Strokes, Until::Now)?;
            let Some(exchange) = exchange(told.replay.strokes(), wanted) else {
                return Ok(Err(RewriteError::Nothing { wanted }));
            };
            loop {
                match told.replay.exchanged(exchange) {
                    Ok(exchanged) => return Ok(Ok(Self { told, exchanged })),
                    Err(ReplayError::EarlierBaseNeeded { stroke }) => {
                        told = match past.tell_before(&told) {
                            Err(PastError::NotKept) => {
                                return Ok(Err(RewriteError::NotKept { stroke }));
                            }
                            other => other?,
                        };
                    }
                    Err(why) => {
                        let sequence = told.last;
                        return Err(PastError::Record { sequence, why });
                    }
                }
            }
        })?
    }

    /// Cuts in it what has come to disk since.
    ///
    /// # Errors
    /// Other clay stands in its place by now, or the files cannot be read.
    pub fn catch_up(&mut self, archive: &Archive) -> Result<(), RewriteError> {
        let epoch = self.exchanged.clay_epoch;
        let gone_on = archive.look_back(|past| past.go_on(&mut self.told));
        if self.told.replay.session().clay_epoch != epoch {
            return Err(RewriteError::Overtaken);
        }
        match gone_on {
            // Somebody else's exchange, of a stroke before the base of this one.
            Err(HomeError::Past(PastError::Record {
                why: ReplayError::EarlierBaseNeeded { .. },
                ..
            })) => return Err(RewriteError::Overtaken),
            other => other?,
        }
        let caught_up = self.told.replay.catch_up(&mut self.exchanged);
        caught_up.map_err(|why| {
            let sequence = self.told.last;
            HomeError::from(PastError::Record { sequence, why }).into()
        })
    }

    /// The clay as it is now, with whatever a session has to know of it; and the settings that hold.
    #[must_use]
    pub fn clay(&self) -> (ExchangedClay, Arc<Settings>) {
        let exchanged = &self.exchanged;
        let clay = ExchangedClay {
            clay: Clay::clone(&exchanged.clay),
            clay_epoch: exchanged.clay_epoch,
            exchange: exchanged.exchange,
            as_of_tick: exchanged.as_of_tick,
        };
        (clay, Arc::clone(&self.told.replay.session().settings))
    }
}

fn exchange(strokes: &Strokes, wanted: Wanted) -> Option<Exchange> {
    let whose = |slot: Option<usize>| slot.map_or(Whose::Anybodys, Whose::Tools);
    match wanted {
        Wanted::Undo(slot) => {
            let stroke = strokes.to_undo(whose(slot))?;
            Some(Exchange::Undone { stroke })
        }
        Wanted::UndoSince(stroke) => {
            let first = stroke.max(strokes.block_from());
            let any = (first..strokes.next()).any(|number| strokes.counts(number, None));
            any.then_some(Exchange::UndoneSince { stroke: first })
        }
        Wanted::Redo(slot) => {
            let stroke = strokes.to_redo(whose(slot))?;
            Some(Exchange::Redone { stroke })
        }
    }
}
