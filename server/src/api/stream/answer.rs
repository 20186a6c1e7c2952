//! What is said to whoever has asked for something.

use std::pin::Pin;

use teleclay_proto::SessionId;
use teleclay_proto::http::Session;
use teleclay_proto::watch::ServerText;

use super::hand::{Hand, Hearing};
use crate::api::problem::Failure;
use crate::api::sessions::change_failure;
use crate::directory::ChangeError;

/// Something on its way through the loop; its answer.
pub(super) type Change = Pin<Box<dyn Future<Output = Answer> + Send>>;

/// What came of it.
pub(super) struct Answer {
    pub(super) text: ServerText,
    /// The lease that was granted.
    pub(super) hand: Option<(Hand, Hearing)>,
    /// Messages of bricks, which follow the text.
    pub(super) bricks: Vec<Vec<u8>>,
}

impl From<ServerText> for Answer {
    fn from(text: ServerText) -> Self {
        Self {
            text,
            hand: None,
            bricks: Vec::new(),
        }
    }
}

/// What a watcher is told about its change. Fields are named as in its message, where the change stands at `prefix`.
pub(super) fn told(
    changed: Result<Result<Session, ChangeError>, Failure>,
    prefix: &str,
    id: &SessionId,
) -> ServerText {
    match changed {
        Ok(Ok(session)) => ServerText::State {
            session: Box::new(session),
        },
        Ok(Err(ChangeError::Field(error))) => problem(error.under(prefix).into()),
        Ok(Err(error)) => problem(change_failure(error, id)),
        Err(failure) => problem(failure),
    }
}

pub(super) fn problem(failure: Failure) -> ServerText {
    ServerText::Problem {
        problem: failure.into_problem(),
    }
}

/// What is said of a change that was asked for.
pub(super) fn told_of_change(
    changed: Result<Result<(), ChangeError>, Failure>,
    id: &SessionId,
) -> ServerText {
    match changed {
        Ok(Ok(())) => ServerText::Done {},
        Ok(Err(error)) => problem(change_failure(error, id)),
        Err(failure) => problem(failure),
    }
}
