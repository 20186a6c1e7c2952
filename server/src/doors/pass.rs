//! What somebody who was let in may do.

use std::fmt;

use teleclay_doors::Guest;
use teleclay_proto::SessionId;
use teleclay_proto::invite::{InviteId, Role};

/// Who was let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    /// Whoever came, where no token is needed; nobody in particular where one is.
    Anybody,
    /// Whoever knows the server's token.
    Token,
    /// Whoever knows an invite's.
    Guest(InviteId),
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Anybody => f.write_str("nobody"),
            Self::Token => f.write_str("token"),
            Self::Guest(id) => write!(f, "invite {id}"),
        }
    }
}

/// What somebody may do, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pass {
    pub(crate) who: Who,
    pub(crate) role: Role,
    /// The one session that it is good for; every one, and the server itself, where there is none.
    pub(crate) session: Option<SessionId>,
}

impl Pass {
    pub(crate) const fn of_anybody() -> Self {
        Self {
            who: Who::Anybody,
            role: Role::Admin,
            session: None,
        }
    }

    pub(crate) const fn of_the_token() -> Self {
        Self {
            who: Who::Token,
            role: Role::Admin,
            session: None,
        }
    }

    pub(crate) fn of_guest(id: InviteId, guest: Guest) -> Self {
        Self {
            who: Who::Guest(id),
            role: guest.role,
            session: Some(guest.session),
        }
    }

    /// Whether it is good for this session.
    pub(crate) fn covers(&self, session: &SessionId) -> bool {
        self.session.as_ref().is_none_or(|own| own == session)
    }
}
