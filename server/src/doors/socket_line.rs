//! What waits for the socket of a hand in a browser: tool frames, and a last word.

use std::sync::{Mutex, MutexGuard, PoisonError};

use teleclay_proto::watch::{FramesKind, FramesWriter};
use tokio::sync::Notify;

/// One message of frames at most, which forgets its oldest.
pub(crate) struct SocketLine {
    waiting: Mutex<Waiting>,
    wake: Notify,
}

struct Waiting {
    frames: FramesWriter,
    /// Frames that were forgotten because nobody took them, and not counted yet.
    forgotten: u64,
    farewell: Option<String>,
}

impl Default for SocketLine {
    fn default() -> Self {
        Self {
            waiting: Mutex::new(Waiting {
                frames: FramesWriter::new(FramesKind::Tool),
                forgotten: 0,
                farewell: None,
            }),
            wake: Notify::new(),
        }
    }
}

impl SocketLine {
    /// Adds a frame, and its trailer. Where a message is full, its frames are old: they make room.
    pub(crate) fn push(&self, frame: &[u8], trailer: &[u8]) {
        let mut waiting = self.waiting();
        let is_first = waiting.frames.message().is_none();
        if waiting.frames.push([frame, trailer]).is_err() {
            waiting.forgotten += waiting.frames.len() as u64;
            waiting.frames.restart();
            // A frame alone always fits.
            let _ = waiting.frames.push([frame, trailer]);
        }
        drop(waiting);
        if is_first {
            self.wake.notify_one();
        }
    }

    /// Says why the lease has ended. The first reason stays.
    pub(crate) fn end(&self, reason: String) {
        self.waiting().farewell.get_or_insert(reason);
        self.wake.notify_one();
    }

    /// Waits until there are frames, or a farewell. Whoever stops waiting misses nothing.
    pub(crate) async fn ready(&self) {
        loop {
            let awoken = self.wake.notified();
            {
                let waiting = self.waiting();
                if waiting.frames.message().is_some() || waiting.farewell.is_some() {
                    return;
                }
            }
            awoken.await;
        }
    }

    /// The frames that wait, as one message.
    pub(crate) fn take(&self) -> Option<Vec<u8>> {
        let mut waiting = self.waiting();
        let message = waiting.frames.message()?.to_vec();
        waiting.frames.restart();
        Some(message)
    }

    /// Why the lease has ended, if it has.
    pub(crate) fn farewell(&self) -> Option<String> {
        self.waiting().farewell.clone()
    }

    /// How many frames were forgotten since the last call.
    pub(crate) fn take_forgotten(&self) -> u64 {
        std::mem::take(&mut self.waiting().forgotten)
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for SocketLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SocketLine").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use teleclay_proto::watch::{FramesView, MAX_FRAMES};

    use super::*;

    fn is_ready(line: &SocketLine) -> bool {
        let ready = std::pin::pin!(line.ready());
        let waker = std::task::Waker::noop();
        ready
            .poll(&mut std::task::Context::from_waker(waker))
            .is_ready()
    }

    #[test]
    fn frames_leave_in_their_order_and_a_line_that_nobody_reads_forgets_the_oldest() {
        let line = SocketLine::default();
        assert!(!is_ready(&line));
        for number in 0..MAX_FRAMES as u8 + 3 {
            line.push(&[number], &[0xaa]);
        }
        assert!(
            is_ready(&line) && is_ready(&line),
            "whoever stops waiting misses nothing"
        );
        let message = line.take().unwrap();
        let view = FramesView::decode(&message).unwrap();
        let newest: Vec<&[u8]> = view.iter().collect();
        let first = MAX_FRAMES as u8;
        assert_eq!(
            newest,
            [[first, 0xaa], [first + 1, 0xaa], [first + 2, 0xaa]]
        );
        assert_eq!(line.take_forgotten(), MAX_FRAMES as u64);
        assert_eq!(line.take_forgotten(), 0);
        assert!(line.take().is_none() && !is_ready(&line));
    }

    #[test]
    fn a_farewell_is_ready_and_its_first_reason_stays() {
        let line = SocketLine::default();
        line.end("stopped".to_owned());
        line.end("ran out".to_owned());
        assert!(is_ready(&line));
        assert_eq!(line.farewell().as_deref(), Some("stopped"));
    }
}
