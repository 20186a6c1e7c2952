//! What a server's yes to a join holds.

use teleclay_proto::join::Granted;
use teleclay_proto::keys::SessionKeys;

/// A lease, and where it holds.
#[derive(Clone, Debug)]
pub(crate) struct JoinGrant {
    pub(crate) keys: SessionKeys,
    pub(crate) granted: Granted,
}
