//! Recordings of a session: begun, ended, listed, deleted.

use std::path::PathBuf;
use std::sync::{Arc, Weak};
use std::time::{SystemTime, UNIX_EPOCH};

use teleclay_proto::http::{FieldError, NewRecording, Recording};
use teleclay_proto::{NodeName, SessionId};
use teleclay_recording::{About, Diagnose, Shelf, ShelfError, Tap};

use super::live::Live;
use super::orders::ChangeError;
use crate::engine::{Answer, TICK, Task};
use crate::ros;

/// Why a recording is not as was asked for.
#[derive(Debug, thiserror::Error)]
pub enum RecordingFailure {
    /// The shelf.
    #[error(transparent)]
    Shelf(#[from] ShelfError),
    /// The session is gone, or the loop does not answer.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// It was broken off.
    #[error("it was broken off")]
    BrokenOff,
}

impl Live {
    /// Records the session from the next ticks on.
    ///
    /// # Errors
    /// There is a recording of this name, or one that goes on; it cannot be written; or the loop does not answer.
    pub async fn start_recording(&self, new: NewRecording) -> Result<Recording, RecordingFailure> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let since_1970 = since_1970.unwrap_or_default();
        let id = match new.name {
            Some(id) => id,
            None => SessionId::new(format!("at-{}", since_1970.as_millis()))
                .map_err(|error| ChangeError::Field(FieldError::new("/name", error.to_string())))?,
        };
        let about = About {
            session: self.id().to_string(),
            offset_ns: (since_1970.as_nanos() as u64).saturating_sub(inner.clock.now_ns()),
            topics: new.topics,
            diagnose: Some(self.diagnose(inner.node.clone())),
        };
        let tools = self.settings().tools();
        let shown_every = new.rate_hz.map_or(1, ticks_between);
        let name = id.clone();
        let (recording, tap) = self
            .on_shelf(move |shelf| {
                // The ring is too large to be made where others wait.
                let (tap, feed) = Tap::new(tools, shown_every);
                Ok((shelf.start(&name, about, feed)?, tap))
            })
            .await?;
        let task = Task::Record {
            session: self.shared.number,
            tap: Some(Box::new(tap)),
        };
        let begun = inner.carry_out(&self.shared, task).await;
        if matches!(begun, Ok(Answer::Done)) {
            return Ok(recording);
        }
        let session = self.id().clone();
        self.on_shelf(move |shelf| {
            shelf.stop(&session, &id, "the loop did not take it up")?;
            shelf.delete(&session, &id)
        })
        .await?;
        Err(begun.err().unwrap_or(ChangeError::Gone).into())
    }

    /// What ROS 2 is told of the session under `/diagnostics`.
    fn diagnose(&self, node: NodeName) -> Diagnose {
        let live = Live::new(Arc::clone(&self.shared), Weak::clone(&self.directory));
        Diagnose(Arc::new(move |time_ns| {
            ros::diagnostics(node.as_str(), &[live.state()], time_ns)
        }))
    }

    /// Ends a recording; one that has ended stays as it is.
    ///
    /// # Errors
    /// There is none of this name, or the loop does not answer.
    pub async fn stop_recording(&self, id: SessionId) -> Result<Recording, RecordingFailure> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        let session = self.id().clone();
        if inner.recordings.running_of(&session).as_ref() == Some(&id) {
            let task = Task::Record {
                session: self.shared.number,
                tap: None,
            };
            inner.carry_out(&self.shared, task).await?;
        }
        self.on_shelf(move |shelf| shelf.stop(&session, &id, "it was stopped"))
            .await
    }

    /// The recordings of the session.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub async fn recordings(&self) -> Result<Vec<Recording>, RecordingFailure> {
        let session = self.id().clone();
        self.on_shelf(move |shelf| shelf.list(&session)).await
    }

    /// Where the file of a recording lies.
    ///
    /// # Errors
    /// There is none of this name.
    pub async fn recording_file(&self, id: SessionId) -> Result<PathBuf, RecordingFailure> {
        let session = self.id().clone();
        self.on_shelf(move |shelf| shelf.file(&session, &id)).await
    }

    /// Deletes a recording that has ended.
    ///
    /// # Errors
    /// There is none of this name, it goes on, or it cannot be deleted.
    pub async fn delete_recording(&self, id: SessionId) -> Result<(), RecordingFailure> {
        let session = self.id().clone();
        self.on_shelf(move |shelf| shelf.delete(&session, &id))
            .await
    }

    /// Does something that waits for a disk.
    async fn on_shelf<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Shelf) -> Result<T, ShelfError> + Send + 'static,
    ) -> Result<T, RecordingFailure> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        let shelf = Arc::clone(&inner.recordings);
        let done = tokio::task::spawn_blocking(move || work(&shelf)).await;
        Ok(done.map_err(|_| RecordingFailure::BrokenOff)??)
    }
}

/// Every how many ticks, to come as near to a rate as whole ticks do.
fn ticks_between(rate_hz: f64) -> u64 {
    (1.0 / (rate_hz * TICK.as_secs_f64())).round().max(1.0) as u64
}
