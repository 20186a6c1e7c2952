//! The queries of a handle: join, leave, fresh clay.
//!
//! Nothing that a server answers is trusted: answers are bounded, parsed and range-checked before anything is built
//! from them.

use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use teleclay_proto::http::{Validate, parse};
use teleclay_proto::join::{
    FreshReply, FreshRequest, JoinReply, JoinRequest, LeaveReply, LeaveRequest, RefusalCode,
};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_proto::{RealmName, SessionId};
use tokio::sync::mpsc::UnboundedSender;
use tokio::time::Instant;
use zenoh::Session;
use zenoh::query::{ConsolidationMode, QueryTarget};

use crate::event::Event;
use crate::grant::JoinGrant;

/// Pause between two attempts to join.
const TRY_EVERY: Duration = Duration::from_millis(200);
/// A server that does not answer is mentioned after this long: opening a connection takes a while of its own.
const SAY_AFTER: Duration = Duration::from_secs(1);
/// An answer to a join is waited for this long: given up sooner, a slow server would grant a lease to nobody.
const JOIN_TIMEOUT: Duration = Duration::from_secs(5);
/// Nothing depends on the answer to a leave: the lease ends by itself.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);
/// A fresh block of the largest size takes seconds to make.
const FRESH_TIMEOUT: Duration = Duration::from_secs(20);
/// A lease that is lost ends at the server after its time; this much later at most, its tool is free again.
const LEASE_GRACE: Duration = Duration::from_secs(2);
/// Longer answers are not read: a description of a block with the most steps has a tenth of it.
const LONGEST_ANSWER: usize = 64 * 1024;

/// Whom to ask, and what for.
#[derive(Clone, Debug)]
pub(crate) struct JoinTarget {
    pub(crate) realm: RealmName,
    pub(crate) session: SessionId,
    pub(crate) request: JoinRequest,
}

/// A lease that was held before, perhaps lost.
#[derive(Clone, Debug)]
pub(crate) struct OldLease {
    pub(crate) keys: SessionKeys,
    pub(crate) lease: u32,
    pub(crate) lease_s: f64,
}

/// Why a session cannot be joined.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    /// The server says no.
    #[error("refused ({code:?}): {reason}")]
    Refused {
        /// Why, for programs.
        code: RefusalCode,
        /// Why, in the server's words.
        reason: String,
    },
    /// The server's answer cannot be worked with.
    #[error("the answer of the server cannot be used: {reason}")]
    Unusable {
        /// What is wrong with it.
        reason: String,
    },
}

/// Asks until a server answers, after a pause. With an old lease, that one is given back first, and a server that is
/// full or about to stop is asked again for as long as the old lease may hold the slot.
///
/// # Errors
/// A server refuses, or answers nonsense.
pub(crate) async fn search(
    control: Session,
    target: JoinTarget,
    old: Option<OldLease>,
    pause: Duration,
    events: UnboundedSender<Event>,
) -> Result<Box<JoinGrant>, JoinError> {
    if let (Some(old), false) = (&old, pause.is_zero()) {
        // Given back at once: nobody waits for a tool because this handle does.
        leave(&control, &old.keys, old.lease).await;
    }
    tokio::time::sleep(pause).await;
    let began = Instant::now();
    let patience = old
        .as_ref()
        .map(|old| Duration::from_secs_f64(old.lease_s) + LEASE_GRACE);
    let mut refused_since = None;
    let mut has_said = old.is_some();
    loop {
        if let Some(old) = &old {
            leave(&control, &old.keys, old.lease).await;
        }
        match ask(&control, &target).await {
            Some(Ok(grant)) => return Ok(grant),
            Some(Err(error)) => {
                let since: &mut Instant = refused_since.get_or_insert_with(Instant::now);
                let may_pass = match &error {
                    JoinError::Refused {
                        code: RefusalCode::ShuttingDown | RefusalCode::Busy,
                        ..
                    } => true,
                    JoinError::Refused {
                        code: RefusalCode::NoFreeTool,
                        ..
                    } => patience.is_some_and(|patience| since.elapsed() < patience),
                    _ => false,
                };
                if !may_pass {
                    return Err(error);
                }
            }
            None => refused_since = None,
        }
        if !has_said && SAY_AFTER < began.elapsed() {
            has_said = true;
            let others = sessions(&control, &target.realm).await;
            // Whoever listened has gone: then nobody needs to know.
            let _ = events.send(Event::Waiting {
                session: target.session.clone(),
                others,
            });
        }
        tokio::time::sleep(TRY_EVERY).await;
    }
}

/// Gives a lease back. `None` when nobody answers.
pub(crate) async fn leave(control: &Session, keys: &SessionKeys, lease: u32) -> Option<LeaveReply> {
    let answers = query(
        control,
        &keys.leave(),
        &LeaveRequest { lease },
        LEAVE_TIMEOUT,
    )
    .await;
    answers.into_iter().find_map(Result::ok)
}

/// Asks for a fresh block.
///
/// # Errors
/// Nobody answers, or nonsense; in words.
pub(crate) async fn fresh(
    slow: Session,
    keys: SessionKeys,
    lease: u32,
) -> Result<FreshReply, String> {
    let answers = query(
        &slow,
        &keys.clay_fresh(),
        &FreshRequest { lease },
        FRESH_TIMEOUT,
    )
    .await;
    answers
        .into_iter()
        .next()
        .unwrap_or_else(|| Err("nobody answers".to_owned()))
}

/// Ticks that a device keeps up with, and that hold what one command can change within what a hand bears.
fn is_our_tick(tick_s: f64) -> bool {
    (0.5e-3..=2e-3).contains(&tick_s)
}

/// Asks once; `None` when nobody answers.
async fn ask(control: &Session, target: &JoinTarget) -> Option<Result<Box<JoinGrant>, JoinError>> {
    let JoinTarget {
        realm,
        session,
        request,
    } = target;
    let keys = SessionKeys::new(realm.clone(), session.clone());
    let answers = query::<JoinReply>(control, &keys.join(), request, JOIN_TIMEOUT).await;
    let mut grant = None;
    let mut error = None;
    for answer in answers {
        match answer {
            Ok(JoinReply::Granted(granted)) if !is_our_tick(granted.parameters.tick_s) => {
                leave(control, &keys, granted.lease).await;
                let tick_ms = granted.parameters.tick_s * 1e3;
                error = Some(unusable(format!(
                    "its loop ticks every {tick_ms} ms, wanted 0.5 to 2 ms"
                )));
            }
            Ok(JoinReply::Granted(granted)) if grant.is_none() => {
                grant = Some(Box::new(JoinGrant {
                    keys: keys.clone(),
                    granted: *granted,
                }));
            }
            Ok(JoinReply::Granted(granted)) => {
                // Several servers run a session of this name, and one lease is enough.
                leave(control, &keys, granted.lease).await;
            }
            Ok(JoinReply::Refused { code, reason }) => {
                error = Some(JoinError::Refused { code, reason })
            }
            Err(reason) => error = error.or_else(|| Some(unusable(reason))),
        }
    }
    grant.map(Ok).or(error.map(Err))
}

/// The sessions of the realm that some server runs.
async fn sessions(control: &Session, realm: &RealmName) -> Vec<SessionId> {
    let mut sessions = Vec::new();
    let Ok(tokens) = control
        .liveliness()
        .get(keys::every_session_alive_in(realm))
        .timeout(LEAVE_TIMEOUT)
        .await
    else {
        return sessions;
    };
    while let Ok(reply) = tokens.recv_async().await {
        if let Ok(sample) = reply.result()
            && let Ok(Key {
                session,
                leaf: Leaf::Alive,
            }) = sample.key_expr().as_str().parse()
        {
            sessions.push(session.session().clone());
        }
    }
    sessions.sort();
    sessions
}

/// Every answer to one question, in the order they come. No answer comes when the link breaks or nobody is there.
async fn query<T>(
    session: &Session,
    key: &str,
    question: &impl Serialize,
    timeout: Duration,
) -> Vec<Result<T, String>>
where
    T: DeserializeOwned + Serialize + Validate,
{
    let question =
        serde_json::to_vec(question).expect("requests have no maps and no values that JSON lacks");
    let sent = session
        .get(key)
        .payload(question)
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(timeout)
        .await;
    let mut answers = Vec::new();
    let Ok(replies) = sent else { return answers };
    while let Ok(reply) = replies.recv_async().await {
        // Zenoh itself answers with an error when the time is over, and servers never do: either way nobody said
        // anything.
        let Ok(sample) = reply.result() else { continue };
        let payload = sample.payload();
        let body = if LONGEST_ANSWER < payload.len() {
            Err(format!(
                "it has {} bytes, want {LONGEST_ANSWER} at most",
                payload.len()
            ))
        } else {
            parse(&payload.to_bytes()).map_err(|error| error.to_string())
        };
        answers.push(body);
    }
    answers
}

fn unusable(reason: String) -> JoinError {
    JoinError::Unusable { reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_loop_whose_tick_a_device_keeps_is_joined() {
        for tick_s in [0.5e-3, 1e-3, 2e-3] {
            assert!(is_our_tick(tick_s), "{tick_s}");
        }
        for tick_s in [1e-5, 0.49e-3, 2.01e-3, 0.1, f64::NAN] {
            assert!(!is_our_tick(tick_s), "{tick_s}");
        }
    }
}
