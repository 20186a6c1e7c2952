//! What is kept of sessions: looked after while they run, looked back at, and rewritten.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use teleclay_clay::Clay;
use teleclay_history::Stroke;
use teleclay_keeping::past::For;
use teleclay_keeping::{
    Archive, HomeError, PastError, Rewrite, RewriteError, Storage, Until, Wanted,
};
use teleclay_proto::http::{ClayReset, History, Session, StrokeReport};
use teleclay_proto::watch::Level;
use teleclay_session::{Outcome, Prepared, Refusal};

use super::Directory;
use super::live::Live;
use super::orders::ChangeError;
use crate::engine::{Mirror, TICK};
use crate::session::{SessionShared, tool_id};

/// How often it is asked whether disks fail, and after how many of these rounds more is done for them.
const LOOK_EVERY: Duration = Duration::from_millis(250);
const ROUNDS_A_LOOK_AFTER: u64 = 20;
/// Clay that was rewritten has to take the place of clay that is being cut: so often it is begun anew because the clay
/// was exchanged meanwhile, and so often it is brought up to date because too much was cut meanwhile.
const REWRITES: usize = 4;
const CATCH_UPS: usize = 64;
/// The beginning of a session comes to disk within this time, or the disk is slow beyond reason.
const BEGUN_WITHIN: Duration = Duration::from_secs(2);
/// What was cut comes to disk at least this often while anything is cut.
const COMMITTED_WITHIN: Duration = Duration::from_millis(25);

/// Why the past cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum PastFailure {
    /// The server keeps nothing.
    #[error("this server keeps no history: it was started with --ephemeral")]
    Ephemeral,
    /// There is nothing of the sort, or no longer.
    #[error(transparent)]
    Rewrite(#[from] RewriteError),
    /// The moment is not kept.
    #[error("{at_s} s lies before everything that is kept of the session's history")]
    NotKept {
        /// The moment, s.
        at_s: f64,
    },
    /// The session refuses, or is gone.
    #[error(transparent)]
    Change(#[from] ChangeError),
}

impl From<HomeError> for PastFailure {
    fn from(error: HomeError) -> Self {
        Self::Rewrite(error.into())
    }
}

/// Why clay was not taken in.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It cannot be kept.
    #[error(transparent)]
    Home(#[from] HomeError),
    /// The session refuses, or is gone.
    #[error(transparent)]
    Change(#[from] ChangeError),
}

impl Directory {
    /// Writes what waits of every session and of every recording, and ends that.
    pub(crate) fn end_writing(&self) {
        self.0.recordings.end_all();
        for live in self.lives() {
            live.shared.archive.iter().for_each(Archive::end);
        }
    }

    /// Makes snapshots where they are due, and tells when a disk begins to fail or works again.
    pub(crate) async fn look_after_archives(&self) {
        let mut failing: HashMap<u32, String> = HashMap::new();
        let mut every = tokio::time::interval(LOOK_EVERY);
        every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        for round in 0_u64.. {
            every.tick().await;
            for live in self.lives() {
                tell_storage(&live, &mut failing);
                if round.is_multiple_of(ROUNDS_A_LOOK_AFTER) {
                    look_after(live).await;
                }
            }
        }
    }
}

impl Live {
    /// The strokes of the present block.
    ///
    /// # Errors
    /// Nothing is kept, or it cannot be read.
    pub async fn history(&self) -> Result<History, PastFailure> {
        let unit_m3 = self.clay().with(|clay, _| clay.unit_volume_m3());
        self.with_archive(move |archive| {
            let history = archive.look_back(|past| {
                let told = past.tell(For::Strokes, Until::Now)?;
                let strokes = told.replay.strokes();
                let of_block = strokes.list().iter();
                let of_block = of_block.filter(|stroke| strokes.block_from() <= stroke.number);
                Ok(History {
                    strokes: of_block.map(|stroke| report(stroke, unit_m3)).collect(),
                    from_s: seconds(past.first_tick()?),
                    to_s: seconds(told.replay.session().tick),
                })
            });
            history.map_err(PastFailure::from)
        })
        .await
    }

    /// The clay as it was.
    ///
    /// # Errors
    /// Nothing is kept of that moment, or it cannot be read.
    pub async fn clay_at(&self, at_s: f64) -> Result<Clay, PastFailure> {
        let tick = (at_s / TICK.as_secs_f64()).round() as u64;
        self.with_archive(move |archive| {
            let state = archive.look_back(|past| past.state(Until::Tick(tick)));
            match state {
                Ok(state) => Ok(state.clay),
                Err(HomeError::Past(PastError::NotKept)) => Err(PastFailure::NotKept { at_s }),
                Err(error) => Err(error.into()),
            }
        })
        .await
    }

    /// Undoes or redoes strokes, while tools go on cutting.
    ///
    /// # Errors
    /// There is nothing of the sort, nothing is kept, or the session refuses.
    pub async fn rewrite(&self, wanted: Wanted) -> Result<Session, PastFailure> {
        for _ in 0..REWRITES {
            match self.try_to_rewrite(wanted).await {
                Err(PastFailure::Rewrite(RewriteError::Overtaken)) => {}
                Err(PastFailure::Change(ChangeError::Refused(Refusal::OtherClay { .. }))) => {}
                Ok(outcome) => {
                    return Ok(Session {
                        revision: outcome.revision,
                        ..self.state()
                    });
                }
                Err(error) => return Err(error),
            }
        }
        Err(RewriteError::Overtaken.into())
    }

    async fn try_to_rewrite(&self, wanted: Wanted) -> Result<Outcome, PastFailure> {
        let mut rewrite = self
            .with_archive(move |archive| Ok(Rewrite::begin(archive, wanted)?))
            .await?;
        let mut refused = None;
        for _ in 0..CATCH_UPS {
            let (next, prepared, mirror) = self
                .with_archive(move |archive| {
                    wait_for_disk(archive);
                    rewrite.catch_up(archive)?;
                    let (prepared, mirror) = prepare(&rewrite);
                    Ok((rewrite, prepared, mirror))
                })
                .await?;
            rewrite = next;
            match self.command(prepared, Some(mirror)).await {
                Err(ChangeError::Refused(refusal @ Refusal::CutMeanwhile { .. })) => {
                    refused = Some(refusal);
                }
                other => return Ok(other?),
            }
        }
        let refusal = refused.unwrap_or(Refusal::Busy);
        Err(ChangeError::Refused(refusal).into())
    }

    /// Puts clay in the place of the session's: a fresh block that no settings describe.
    ///
    /// # Errors
    /// It cannot be kept, or the session refuses.
    pub async fn put_clay(&self, clay: Clay) -> Result<Session, ImportError> {
        let shared = Arc::clone(&self.shared);
        let clay = tokio::task::spawn_blocking(move || {
            let mut clay = clay;
            if let Some(archive) = &shared.archive {
                // Whole and synced before a record tells of it.
                archive.keep_block(&mut clay)?;
            }
            Ok::<_, HomeError>(clay)
        });
        // It is not joined only where the server ends.
        let clay = Arc::new(clay.await.map_err(|_| ChangeError::Gone)??);
        let outcome = self
            .carry_out_prepared(move |settings| {
                let settings_then = settings.with_fresh_block(&ClayReset::default());
                let settings_then = settings_then.map_err(Refusal::Field)?;
                Prepared::given_block(settings_then, Clay::clone(&clay), settings.revision)
            })
            .await?;
        Ok(Session {
            revision: outcome.revision,
            ..self.state()
        })
    }

    /// Waits until the beginning of a session is on disk, so that whoever is told that it was made finds it after a
    /// kill. A disk that fails, or is slow beyond reason, is told of by the session's state.
    pub(super) async fn is_kept(&self) {
        let Some(archive) = &self.shared.archive else {
            return;
        };
        let began = Instant::now();
        while archive.durable() == 0
            && !matches!(archive.storage(), Storage::Failed { .. })
            && began.elapsed() < BEGUN_WITHIN
        {
            tokio::time::sleep(TICK).await;
        }
    }

    /// Does something with the files, on a thread that may take its time.
    async fn with_archive<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Archive) -> Result<T, PastFailure> + Send + 'static,
    ) -> Result<T, PastFailure> {
        let shared: Arc<SessionShared> = Arc::clone(&self.shared);
        // However many ask, they wait here, where waiting takes no thread from those who change sessions.
        let turn = Arc::clone(&self.shared.looking_back).acquire_owned().await;
        // It is never closed.
        let turn = turn.map_err(|_| ChangeError::Gone)?;
        let done = tokio::task::spawn_blocking(move || {
            // Until the work is done, whether or not anybody still waits for it.
            let _turn = turn;
            match &shared.archive {
                Some(archive) => work(archive),
                None => Err(PastFailure::Ephemeral),
            }
        });
        // It is not joined only where the server ends.
        done.await.map_err(|_| ChangeError::Gone)?
    }
}

/// Right after something came to disk, least is missing there.
fn wait_for_disk(archive: &Archive) {
    let (began, known) = (Instant::now(), archive.durable());
    while archive.durable() == known && began.elapsed() < COMMITTED_WITHIN {
        std::thread::sleep(TICK);
    }
}

/// The command that puts rewritten clay in its place, and the watchers' copy of it.
fn prepare(rewrite: &Rewrite) -> (Prepared, Mirror) {
    let (mut exchanged, settings) = rewrite.clay();
    // Watchers get all of it at once; what they have to be told brick by brick is what follows.
    exchanged.clay.drain_changed(usize::MAX, |_, _| {});
    let mirror = Mirror {
        clay: exchanged.clay.clone(),
        shape: settings.spec.clay.shape.clone(),
        epoch: exchanged.clay_epoch.wrapping_add(1),
    };
    (Prepared::exchange(exchanged, &settings), mirror)
}

fn seconds(tick: u64) -> f64 {
    tick as f64 * TICK.as_secs_f64()
}

fn report(stroke: &Stroke, unit_m3: f64) -> StrokeReport {
    StrokeReport {
        number: stroke.number,
        tool: tool_id(stroke.slot),
        operator: stroke.operator.to_string(),
        from_s: seconds(stroke.from_tick),
        to_s: seconds(stroke.to_tick),
        removed_volume_m3: stroke.removed_units as f64 * unit_m3,
        undone: stroke.is_undone,
    }
}

/// Tells watchers and the log when the disk of a session begins to fail, and when it works again.
fn tell_storage(live: &Live, failing: &mut HashMap<u32, String>) {
    let Some(archive) = &live.shared.archive else {
        return;
    };
    let number = live.shared.number;
    match archive.storage() {
        Storage::Failed { reason } if failing.get(&number) != Some(&reason) => {
            let words = format!("storage.failed: {reason}; nothing is cut until it can be kept");
            live.shared.emit(Level::Error, words);
            failing.insert(number, reason);
        }
        Storage::Durable if failing.remove(&number).is_some() => {
            live.shared.emit(
                Level::Info,
                "the disk works again, and all is kept".to_owned(),
            );
        }
        Storage::Failed { .. } | Storage::Durable | Storage::Behind => {}
    }
}

async fn look_after(live: Live) {
    let id = live.id().clone();
    let looked =
        tokio::task::spawn_blocking(move || live.shared.archive.as_ref().map(Archive::look_after));
    // It is not joined only where the server ends.
    if let Ok(Some(Err(error))) = looked.await {
        tracing::warn!(session = %id, "no snapshot of its history: {error}");
    }
}
