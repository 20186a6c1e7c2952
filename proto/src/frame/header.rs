//! What both frames begin with.

use super::{MAGIC, VERSION};
use crate::{FrameError, Scheme};
use teleclay_wire::bytes::{Reader, Writer};

/// Bytes of the header, the state byte near its end included.
pub(super) const LENGTH: usize = 48;

/// What both frames begin with: who speaks, when, and under which parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// The lease granted on joining. A frame under any other lease is dropped.
    pub lease: u32,
    /// Number of the frame, one more each tick; wraps, see [`is_after`](crate::is_after).
    pub sequence: u32,
    /// When the frame was sent, nanoseconds of the sender's own monotonic clock. Never 0.
    pub sent_ns: u64,
    /// `sent_ns` of the newest frame that came from the peer; 0 before the first.
    pub echo_ns: u64,
    /// How long the sender held that frame before it sent this one, nanoseconds; saturates at 4.29 s.
    pub echo_hold_ns: u32,
    /// The scheme this side runs.
    pub scheme: Scheme,
    /// Counts the changes of the session, modulo 2³²: the one that the tool side is at, and up, the newest that the
    /// handle has heard of.
    pub revision: u32,
    /// Counts the fresh blocks of clay: sweeps of an earlier epoch cut clay that is gone.
    pub clay_epoch: u32,
    /// Counts the servers that have run the session: what is meant for an earlier one does not concern the present one.
    pub ownership_epoch: u32,
}

impl Header {
    pub(super) fn write(&self, kind: u8, state: u8, writer: &mut Writer<'_>) {
        writer.put(MAGIC);
        writer.put([VERSION, kind]);
        writer.put(self.lease.to_le_bytes());
        writer.put(self.sequence.to_le_bytes());
        writer.put(self.echo_hold_ns.to_le_bytes());
        writer.put(self.sent_ns.to_le_bytes());
        writer.put(self.echo_ns.to_le_bytes());
        writer.put(self.clay_epoch.to_le_bytes());
        writer.put(self.ownership_epoch.to_le_bytes());
        writer.put(self.revision.to_le_bytes());
        writer.put([self.scheme.byte(), state, 0, 0]);
    }

    /// The header and the state byte that follows it.
    pub(super) fn read(kind: u8, reader: &mut Reader<'_>) -> Result<(Self, u8), FrameError> {
        let magic = reader.array()?;
        if magic != MAGIC {
            return Err(FrameError::WrongMagic {
                got: magic,
                want: MAGIC,
            });
        }
        let version = reader.u8()?;
        if version != VERSION {
            return Err(FrameError::WrongVersion {
                got: version,
                want: VERSION,
            });
        }
        let got = reader.u8()?;
        if got != kind {
            return Err(FrameError::WrongKind { got, want: kind });
        }
        let lease = reader.u32()?;
        let sequence = reader.u32()?;
        let echo_hold_ns = reader.u32()?;
        let sent_ns = reader.u64()?;
        let echo_ns = reader.u64()?;
        let clay_epoch = reader.u32()?;
        let ownership_epoch = reader.u32()?;
        let revision = reader.u32()?;
        let scheme = Scheme::from_byte(reader.u8()?)?;
        let state = reader.u8()?;
        reader.zeros::<2>("header")?;
        let header = Self {
            lease,
            sequence,
            sent_ns,
            echo_ns,
            echo_hold_ns,
            scheme,
            revision,
            clay_epoch,
            ownership_epoch,
        };
        Ok((header, state))
    }
}
