//! Both Zenoh sessions of the moment, for whoever puts something on one.

use zenoh::Session;

/// The sessions of the moment.
#[derive(Clone)]
pub(super) struct Sessions {
    pub(super) control: Session,
    pub(super) slow: Session,
}

impl Sessions {
    pub(super) async fn close(&self) {
        for session in [&self.control, &self.slow] {
            if let Err(error) = session.close().await {
                tracing::warn!(%error, "a zenoh session did not close cleanly");
            }
        }
    }
}
