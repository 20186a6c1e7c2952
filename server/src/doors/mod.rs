//! Who is let in, and how far: whoever knows the server's token may do everything, whoever was invited what the invite
//! says, and nobody else anything. Where there is no token, everybody on this machine may do everything.
//!
//! | module | holds |
//! |---|---|
//! | this file | tokens and joins, and what they are good for |
//! | `pass` | what somebody who was let in may do |
//! | `channels` | the line to each holder of a tool |
//! | [`certificates`] | what the server shows of itself |
//! | [`command`] | the commands that invite people |

pub mod certificates;
mod channels;
pub mod command;
mod pass;
mod socket_line;

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use teleclay_channel::{Answering, Challenge, Challenges, Context, Secret, Unwelcome};
use teleclay_doors::audit::{Audit, Deed};
use teleclay_doors::{Guest, Invites};
use teleclay_proto::SessionId;
use teleclay_proto::invite::{InviteId, InviteToken, Role};
use teleclay_proto::join::{RefusalCode, SealedJoin};

pub(crate) use channels::{Channels, LeaseChannel, Way};
pub(crate) use pass::{Pass, Who};
pub(crate) use socket_line::SocketLine;

/// What is said to a join that is not heard, code and reason for anybody; nothing to one that another server is asked.
pub(crate) type Unheard = Option<(RefusalCode, String)>;

/// A join that was heard.
pub(crate) struct Heard {
    pub(crate) payload: Vec<u8>,
    pub(crate) answering: Answering,
    pub(crate) pass: Pass,
}

/// What callers and joins have to show.
pub struct Doors {
    token: Option<Secret>,
    invites: Option<Invites>,
    audit: Option<Audit>,
    challenges: Mutex<Challenges>,
    began: Instant,
}

impl Doors {
    /// Where everybody may do everything: for a server that nobody reaches from elsewhere.
    #[must_use]
    pub fn open() -> Self {
        Self {
            token: None,
            invites: None,
            audit: None,
            challenges: Mutex::new(Challenges::new()),
            began: Instant::now(),
        }
    }

    /// Where whoever shows this token may do everything, and nobody else anything.
    #[must_use]
    pub fn with_token(token: &str) -> Self {
        Self {
            token: Some(Secret::of_token(token)),
            ..Self::open()
        }
    }

    /// Lets those in, too, who were invited.
    #[must_use]
    pub fn and_guests(self, invites: Invites) -> Self {
        Self {
            invites: Some(invites),
            ..self
        }
    }

    /// Writes down who does what.
    #[must_use]
    pub fn watched(self, audit: Audit) -> Self {
        Self {
            audit: Some(audit),
            ..self
        }
    }

    /// Whether a token must be shown. Where none must, everybody may look, too.
    pub(crate) fn needs_token(&self) -> bool {
        self.token.is_some()
    }

    /// A challenge, for anybody.
    pub(crate) fn challenge(&self) -> [u8; 32] {
        let challenges = self
            .challenges
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        *challenges.give(self.began.elapsed()).as_bytes()
    }

    /// What somebody may do who shows this token over HTTP, nothing included.
    pub(crate) fn admit(&self, shown: Option<&str>) -> Option<Pass> {
        let Some(token) = &self.token else {
            return Some(Pass::of_anybody());
        };
        let shown = shown?;
        let secret = Secret::of_token(shown);
        if secret == *token {
            return Some(Pass::of_the_token());
        }
        let id = shown.parse::<InviteToken>().ok()?.id();
        let guest = self.guest(id)?;
        (guest.secret == secret).then(|| Pass::of_guest(id, guest))
    }

    /// Whether a pass that was given before is good still.
    pub(crate) fn is_good(&self, pass: &Pass) -> bool {
        match pass.who {
            Who::Anybody | Who::Token => true,
            Who::Guest(id) => self.guest(id).is_some(),
        }
    }

    /// What a join says that was asked on `key` for `session`, whom to answer, and what they may do.
    ///
    /// # Errors
    /// It is not to be heard.
    pub(crate) fn hear(
        &self,
        key: &str,
        session: &SessionId,
        join: &SealedJoin,
    ) -> Result<Heard, Unheard> {
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
        let rejected = |reason: &str| {
            let who = join.invite.map_or(Who::Anybody, Who::Guest);
            self.tell_refused(&who, "join", Some(session), "rejected");
            Some((RefusalCode::TokenRejected, reason.to_owned()))
        };
        let (secret, pass) = match join.invite {
            Some(id) => {
                let guest = self.guest(id).ok_or_else(|| {
                    rejected("the invite has ended, was taken back, or is another server's")
                })?;
                (guest.secret.clone(), Pass::of_guest(id, guest))
            }
            None => match &self.token {
                Some(token) => (token.clone(), Pass::of_the_token()),
                None => (Secret::none(), Pass::of_anybody()),
            },
        };
        let context = Context {
            key,
            challenge: &challenge,
        };
        let (payload, answering) = Answering::hear(&secret, context, &join.message)
            .map_err(|_| rejected(self.why_not(join.invite)))?;
        challenges.take(now, &challenge).map_err(unwelcome)?;
        Ok(Heard {
            payload,
            answering,
            pass,
        })
    }

    fn why_not(&self, invite: Option<InviteId>) -> &'static str {
        match (invite, self.needs_token()) {
            (Some(_), _) => "the token is not that of the invite",
            (None, true) => "the token is not the server's",
            (None, false) => "the handle has a token and this server has none",
        }
    }

    /// Writes down what somebody did.
    pub(crate) fn tell(&self, who: &Who, did: &str, session: Option<&SessionId>, outcome: &str) {
        self.tell_deed(deed(who, did, session, outcome));
    }

    /// Writes down what somebody was kept from.
    pub(crate) fn tell_refused(
        &self,
        who: &Who,
        did: &str,
        session: Option<&SessionId>,
        outcome: &str,
    ) {
        self.tell_refused_deed(deed(who, did, session, outcome));
    }

    /// As [`tell`](Self::tell), with all that is known of it.
    pub(crate) fn tell_deed(&self, deed: Deed) {
        if let Some(audit) = &self.audit {
            audit.tell(deed);
        }
    }

    /// As [`tell_refused`](Self::tell_refused), with all that is known of it.
    pub(crate) fn tell_refused_deed(&self, deed: Deed) {
        if let Some(audit) = &self.audit {
            audit.tell_refused(Instant::now(), deed);
        }
    }

    /// Waits until what was done is written down, for a while at most.
    pub(crate) fn settle(&self, within: Duration) {
        if let Some(audit) = &self.audit {
            audit.settle(within);
        }
    }

    /// Whoever was invited under this number, as far as it can be read: where it cannot, nobody.
    fn guest(&self, id: InviteId) -> Option<Guest> {
        let guest = self.invites.as_ref()?.guest(SystemTime::now(), id);
        guest.unwrap_or_else(|error| {
            tracing::error!(%error, "nobody with an invite is let in");
            None
        })
    }
}

impl std::fmt::Debug for Doors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Doors")
            .field("needs_token", &self.needs_token())
            .finish_non_exhaustive()
    }
}

fn deed(who: &Who, did: &str, session: Option<&SessionId>, outcome: &str) -> Deed {
    Deed {
        who: who.to_string(),
        from: None,
        did: did.to_owned(),
        session: session.map(ToString::to_string),
        outcome: outcome.to_owned(),
    }
}

/// The least that a join needs.
pub(crate) const TO_HOLD_A_TOOL: Role = Role::Operator;
