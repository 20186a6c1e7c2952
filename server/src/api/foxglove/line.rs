//! The sending half of a socket: one burst of messages at a time is on its way, and nothing else waits for it.

use std::pin::Pin;

use axum::extract::ws::Message;
use tokio::time::timeout;

use crate::api::socket::end::End;
use crate::api::socket::{CLOSE_TIMEOUT, Mouth, hand_over_all};

/// Where messages go.
pub(super) enum Line {
    Idle(Mouth),
    Busy(Sending),
    Broken,
}

type Sending = Pin<Box<dyn Future<Output = Result<Mouth, End>> + Send>>;

impl Line {
    /// Sends a burst; to be called where the line is idle.
    pub(super) fn begin(&mut self, burst: Vec<Message>) {
        *self = match std::mem::replace(self, Self::Broken) {
            Self::Idle(mut mouth) => Self::Busy(Box::pin(async move {
                hand_over_all(&mut mouth, burst).await?;
                Ok(mouth)
            })),
            other => other,
        };
    }

    pub(super) const fn is_idle(&self) -> bool {
        matches!(self, Self::Idle(_))
    }

    /// Waits until the burst is handed over; for ever where none is on its way.
    ///
    /// # Errors
    /// It was not taken in time, or the connection broke.
    pub(super) async fn is_done(&mut self) -> Result<(), End> {
        let Self::Busy(sending) = self else {
            return std::future::pending().await;
        };
        let sent = sending.as_mut().await;
        *self = Self::Broken;
        *self = Self::Idle(sent?);
        Ok(())
    }

    /// What is left of it to say goodbye on.
    pub(super) async fn end(self) -> Option<Mouth> {
        match self {
            Self::Idle(mouth) => Some(mouth),
            Self::Busy(sending) => timeout(CLOSE_TIMEOUT, sending).await.ok()?.ok(),
            Self::Broken => None,
        }
    }
}
