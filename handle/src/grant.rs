//! What a server's yes to a join holds.

use std::sync::Arc;

use teleclay_channel::Channel;
use teleclay_proto::join::Granted;
use teleclay_proto::keys::SessionKeys;

/// A lease, and where it holds.
#[derive(Clone, Debug)]
pub(crate) struct JoinGrant {
    pub(crate) keys: SessionKeys,
    pub(crate) granted: Granted,
    /// What this handle and that server know each other by.
    pub(crate) channel: Arc<Channel>,
}
