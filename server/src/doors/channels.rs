//! The line to each holder of a tool.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use teleclay_channel::{Channel, Forged, Keys, Purpose, TRAILER};
use teleclay_proto::http::parse;
use teleclay_proto::join::LeaseRequest;

use super::{Pass, SocketLine};
use crate::engine::TOOLS;

/// One lease's end of the line.
#[derive(Debug)]
pub(crate) struct LeaseChannel {
    pub(crate) lease: u32,
    pub(crate) channel: Channel,
    /// Whose it is.
    pub(crate) pass: Pass,
    /// How its frames go to the handle.
    pub(crate) way: Way,
}

/// How frames go to a handle.
#[derive(Clone, Debug)]
pub(crate) enum Way {
    /// They are put on its key.
    Zenoh,
    /// They wait for its socket.
    Socket(Arc<SocketLine>),
}

impl LeaseChannel {
    pub(crate) fn new(lease: u32, keys: &Keys, pass: Pass, way: Way) -> Self {
        Self {
            lease,
            channel: Channel::of_server(keys),
            pass,
            way,
        }
    }
}

/// What the present and the last holders of a session's tools speak through.
#[derive(Debug, Default)]
pub(crate) struct Channels {
    slots: Mutex<[Option<Arc<LeaseChannel>>; TOOLS]>,
    unheard: AtomicU64,
}

impl Channels {
    /// A new holder; the one before is not heard any more.
    pub(crate) fn open(&self, slot: usize, holder: Arc<LeaseChannel>) {
        self.slots()[slot] = Some(holder);
    }

    /// Everybody who holds a tool, or held it last, by its slot.
    pub(crate) fn holders(&self) -> Vec<(usize, Arc<LeaseChannel>)> {
        let slots = self.slots();
        let numbered = slots.iter().cloned().enumerate();
        numbered
            .filter_map(|(slot, holder)| Some((slot, holder?)))
            .collect()
    }

    /// The channel of a tool.
    pub(crate) fn at(&self, slot: usize) -> Option<Arc<LeaseChannel>> {
        self.slots().get(slot).cloned().flatten()
    }

    /// Lease and channel of whoever sealed a question.
    ///
    /// # Errors
    /// None of those who hold tools here did, or the question was heard before.
    pub(crate) fn asker(
        &self,
        purpose: Purpose,
        sealed: &[u8],
    ) -> Result<Arc<LeaseChannel>, Forged> {
        let asked = sealed
            .len()
            .checked_sub(TRAILER)
            .and_then(|length| parse::<LeaseRequest>(&sealed[..length]).ok());
        let holder = asked.and_then(|LeaseRequest { lease }| {
            let slots = self.slots();
            let mut channels = slots.iter().flatten();
            channels.find(|channel| channel.lease == lease).cloned()
        });
        let holder = holder.ok_or(Forged::Unauthentic)?;
        holder.channel.open(purpose, sealed)?;
        Ok(holder)
    }

    /// A message that no holder wrote, or that came again. Gives how many came, where that is worth a word: one, ten,
    /// a hundred.
    pub(crate) fn count_unheard(&self) -> Option<u64> {
        let count = self.unheard.fetch_add(1, Ordering::Relaxed) + 1;
        (10_u64.pow(count.ilog10()) == count).then_some(count)
    }

    /// How many such messages came.
    pub(crate) fn unheard(&self) -> u64 {
        self.unheard.load(Ordering::Relaxed)
    }

    fn slots(&self) -> std::sync::MutexGuard<'_, [Option<Arc<LeaseChannel>>; TOOLS]> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
