//! A recording of what a rig does, written as it happens by the writer that servers have.

use std::io::Write;
use std::sync::{Arc, Mutex, MutexGuard};

use teleclay_link::time::Timestamp;
use teleclay_proto::frame::HandleFrame;
use teleclay_recording::{About, Feed, Scribe, Tap, WriteError};
use teleclay_session::{Event, Session};
use teleclay_sim::rig::Ear;

/// Parcels that one tick brings at most, with room to spare.
const PARCELS: usize = 1000;

/// Records a rig. Copies are the same recording: one hears the rig, another ends it.
pub struct Studio<W: Write>(Arc<Mutex<Inner<W>>>);

struct Inner<W: Write> {
    tap: Tap,
    feed: Feed,
    scribe: Scribe<W>,
    error: Option<WriteError>,
}

impl<W: Write> Clone for Studio<W> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<W: Write> Studio<W> {
    /// For a session of so many tools, which are shown every `shown_every` ticks.
    ///
    /// # Errors
    /// The file cannot be begun.
    pub fn new(sink: W, about: About, tools: usize, shown_every: u64) -> Result<Self, WriteError> {
        let (tap, feed) = Tap::new(tools, shown_every);
        Ok(Self(Arc::new(Mutex::new(Inner {
            tap,
            feed,
            scribe: Scribe::new(sink, about)?,
            error: None,
        }))))
    }

    /// Closes the chunk that is under way.
    ///
    /// # Errors
    /// The file could not be written.
    pub fn flush(&self) -> Result<(), WriteError> {
        let mut inner = self.inner();
        inner.error.take().map_or(Ok(()), Err)?;
        inner.scribe.flush()
    }

    /// Ends the recording of a session as it is.
    ///
    /// # Errors
    /// The file could not be written.
    pub fn finish(&self, session: &mut Session) -> Result<(), WriteError> {
        let mut inner = self.inner();
        inner.error.take().map_or(Ok(()), Err)?;
        inner.tap.end(session);
        inner.write()?;
        inner.scribe.finish("the run is over")
    }

    fn inner(&self) -> MutexGuard<'_, Inner<W>> {
        self.0.lock().expect("no holder panics")
    }
}

impl<W: Write> Inner<W> {
    fn write(&mut self) -> Result<(), WriteError> {
        self.scribe.take_from(&mut self.feed, PARCELS).map(drop)
    }
}

impl<W: Write + Send> Ear for Studio<W> {
    fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame) {
        self.inner().tap.on_frame(slot, arrived, frame);
    }

    fn on_tick(&mut self, session: &mut Session, now: Timestamp, events: &[Event]) {
        let mut inner = self.inner();
        inner.tap.on_tick(session, now, events.iter());
        if inner.error.is_none() {
            inner.error = inner.write().err();
        }
    }
}
