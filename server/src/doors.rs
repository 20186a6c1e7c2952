//! Who is heard on Zenoh: whoever knows the secret may join, whoever has joined speaks under its lease, and nobody
//! else.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use teleclay_channel::{
    Answering, Challenge, Challenges, Channel, Context, Forged, Purpose, Secret, TRAILER, Unwelcome,
};
use teleclay_proto::http::parse;
use teleclay_proto::join::{LeaseRequest, RefusalCode, SealedJoin};

use crate::engine::TOOLS;

/// What is said to a join that is not heard, code and reason for anybody; nothing to one that another server is asked.
pub(crate) type Unheard = Option<(RefusalCode, String)>;

/// What a join has to show.
pub(crate) struct Doors {
    secret: Secret,
    needs_token: bool,
    challenges: Mutex<Challenges>,
    began: Instant,
}

impl Doors {
    /// For a server with a token, or one that takes anybody.
    pub(crate) fn new(token: Option<&str>) -> Self {
        Self {
            secret: token.map_or(Secret::none(), Secret::of_token),
            needs_token: token.is_some(),
            challenges: Mutex::new(Challenges::new()),
            began: Instant::now(),
        }
    }

    /// Whether a join must show that it knows the token. Where none must, everybody may look, too.
    pub(crate) fn needs_token(&self) -> bool {
        self.needs_token
    }

    /// A challenge, for anybody.
    pub(crate) fn challenge(&self) -> [u8; 32] {
        let challenges = self
            .challenges
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        *challenges.give(self.began.elapsed()).as_bytes()
    }

    /// What a join says that was asked on `key`, and whom to answer.
    ///
    /// # Errors
    /// It is not to be heard.
    pub(crate) fn hear(
        &self,
        key: &str,
        join: &SealedJoin,
    ) -> Result<(Vec<u8>, Answering), Unheard> {
        let challenge = Challenge::from_bytes(join.challenge);
        let unwelcome = |why| match why {
            // It may be the challenge of another server of the realm, which will answer.
            Unwelcome::Foreign => None,
            why => Some((RefusalCode::Busy, why.to_string())),
        };
        let now = self.began.elapsed();
        let mut challenges = self
            .challenges
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        challenges.check(now, &challenge).map_err(unwelcome)?;
        let context = Context {
            key,
            challenge: &challenge,
        };
        let heard = Answering::hear(&self.secret, context, &join.message).map_err(|_| {
            let reason = if self.needs_token {
                "the token is not the server's"
            } else {
                "the handle has a token and this server has none"
            };
            Some((RefusalCode::TokenRejected, reason.to_owned()))
        })?;
        challenges.take(now, &challenge).map_err(unwelcome)?;
        Ok(heard)
    }
}

/// One lease's end of the line.
#[derive(Debug)]
pub(crate) struct LeaseChannel {
    pub(crate) lease: u32,
    pub(crate) channel: Channel,
}

/// What the present and the last holders of a session's tools speak through.
#[derive(Debug, Default)]
pub(crate) struct Channels {
    slots: Mutex<[Option<Arc<LeaseChannel>>; TOOLS]>,
    unheard: AtomicU64,
}

impl Channels {
    /// A new holder; the one before is not heard any more.
    pub(crate) fn open(&self, slot: usize, lease: u32, channel: Channel) {
        let channel = Arc::new(LeaseChannel { lease, channel });
        self.slots()[slot] = Some(channel);
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
