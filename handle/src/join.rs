//! The queries of a handle: join, leave, fresh clay.
//!
//! Anybody may answer a query. A join's answer counts when it comes from whoever knows the secret and gave the
//! challenge; what anybody else says is worth something only where nobody says anything better. Nor is a server's
//! answer trusted: it is bounded, parsed and range-checked before anything is built from it.

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use teleclay_bilateral::is_device_tick;
use teleclay_channel::{Asking, Challenge, Channel, Context, Purpose, Secret};
use teleclay_proto::http::{Validate, parse};
use teleclay_proto::invite::InviteId;
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, FreshReply, JoinReply, JoinRequest, LeaveReply, RefusalCode,
    SealedJoin, SealedReply,
};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::certificate::ProbeError;
use tokio::sync::mpsc::UnboundedSender;
use tokio::task::JoinSet;
use tokio::time::{Instant, timeout_at};
use zenoh::Session;
use zenoh::handlers::FifoChannelHandler;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};

use crate::door::{Door, Lookout};
use crate::event::Event;
use crate::grant::JoinGrant;
use crate::question::Question;

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
/// A tool that is kept for somebody else is kept no longer than that.
const RESERVED_AT_MOST: Duration = Duration::from_secs(11);
/// Longer answers are not read: a description of a block with the most steps has a tenth of it.
const LONGEST_ANSWER: usize = 64 * 1024;

/// Servers of a realm that are asked at most; whoever floods the challenges with others is one of as many.
const MOST_SERVERS: usize = 8;
/// Once a challenge has come, others are waited for this long.
const MORE_CHALLENGES: Duration = Duration::from_millis(200);

/// Whom to ask, and what for.
#[derive(Clone, Debug)]
pub(crate) struct JoinTarget {
    pub(crate) realm: RealmName,
    pub(crate) session: SessionId,
    pub(crate) request: JoinRequest,
    /// The server's token, when it asks for one, or that of an invite.
    pub(crate) token: Option<String>,
    /// Which invite, if the token is that of one.
    pub(crate) invite: Option<InviteId>,
    /// The way to the server.
    pub(crate) door: Door,
    /// Whether to ask on while the session is stopped.
    pub(crate) waits_out_stops: bool,
}

/// A lease that was held before, perhaps lost.
#[derive(Clone, Debug)]
pub(crate) struct OldLease {
    pub(crate) keys: SessionKeys,
    pub(crate) channel: Arc<Channel>,
    pub(crate) lease: u32,
    pub(crate) lease_s: f64,
}

/// What came of one attempt to join.
enum Attempt {
    Granted(Box<JoinGrant>),
    /// The server said so.
    Refused(JoinError),
    /// Somebody said so.
    Hearsay(JoinError),
    Silence,
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
    /// Somebody else answers at the server's place by now.
    #[error(transparent)]
    Certificate(#[from] ProbeError),
    /// The server's answer cannot be worked with.
    #[error("the answer of the server cannot be used: {reason}")]
    Unusable {
        /// What is wrong with it.
        reason: String,
    },
}

/// Asks until a server answers, after a pause. With an old lease, that one is given back first, and a server that is
/// full is asked again for as long as the old lease may hold the slot; one that is about to end, for as long as that
/// lasts, and a session that is stopped likewise where the target says so.
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
        leave(&control, &old.keys, &old.channel, old.lease).await;
    }
    tokio::time::sleep(pause).await;
    let began = Instant::now();
    let patience = old
        .as_ref()
        .map(|old| Duration::from_secs_f64(old.lease_s) + LEASE_GRACE);
    let mut refused_since = None;
    let mut has_said = old.is_some();
    let mut has_said_stopped = false;
    let mut lookout = Lookout::new(target.door.clone());
    loop {
        if let Some(old) = &old {
            leave(&control, &old.keys, &old.channel, old.lease).await;
        }
        match ask(&control, &target).await {
            Attempt::Granted(grant) => return Ok(grant),
            Attempt::Silence => {
                refused_since = None;
                lookout.on_silence().await?;
            }
            // Somebody's word does not end what has been held: the server may be away for a moment.
            Attempt::Hearsay(_) if old.is_some() => {}
            Attempt::Refused(error) | Attempt::Hearsay(error) => {
                lookout.on_heard();
                let since: &mut Instant = refused_since.get_or_insert_with(Instant::now);
                let may_pass = match &error {
                    JoinError::Refused {
                        code: RefusalCode::ShuttingDown | RefusalCode::Busy,
                        ..
                    } => true,
                    // Whoever held a tool waits until there is time for it again.
                    JoinError::Refused {
                        code: RefusalCode::NoTickTime,
                        ..
                    } => old.is_some(),
                    JoinError::Refused {
                        code: RefusalCode::Stopped,
                        reason,
                    } if target.waits_out_stops => {
                        if !std::mem::replace(&mut has_said_stopped, true) {
                            let reason = reason.clone();
                            // Whoever listened has gone: then nobody needs to know.
                            let _ = events.send(Event::Stopped { reason });
                        }
                        true
                    }
                    JoinError::Refused {
                        code: RefusalCode::Reserved,
                        ..
                    } => since.elapsed() < RESERVED_AT_MOST,
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

/// Gives a lease back. `None` when the server does not answer.
pub(crate) async fn leave(
    control: &Session,
    keys: &SessionKeys,
    channel: &Channel,
    lease: u32,
) -> Option<LeaveReply> {
    let question = Question {
        session: control,
        key: &keys.leave(),
        purpose: Purpose::Leave,
        channel,
        lease,
        within: LEAVE_TIMEOUT,
        longest: LONGEST_ANSWER,
    };
    parse(&question.ask().await.ok()?).ok()
}

/// Asks for a fresh block.
///
/// # Errors
/// The server does not answer, or says nonsense; in words.
pub(crate) async fn fresh(slow: Session, grant: JoinGrant) -> Result<FreshReply, String> {
    let question = Question {
        session: &slow,
        key: &grant.keys.clay_fresh(),
        purpose: Purpose::ClayFresh,
        channel: &grant.channel,
        lease: grant.granted.lease,
        within: FRESH_TIMEOUT,
        longest: LONGEST_ANSWER,
    };
    parse(&question.ask().await?).map_err(|error| error.to_string())
}

/// Asks once.
async fn ask(control: &Session, target: &JoinTarget) -> Attempt {
    let keys = SessionKeys::new(target.realm.clone(), target.session.clone());
    let (challenges, mut best) = challenges(control, &keys, target).await;
    let mut attempts = JoinSet::new();
    for challenge in challenges {
        attempts.spawn(try_to_join(
            control.clone(),
            keys.clone(),
            target.clone(),
            challenge,
        ));
    }
    while let Some(attempt) = attempts.join_next().await {
        match attempt {
            Ok(Attempt::Granted(grant)) => {
                // Several servers run a session of this name, and one lease is enough. Nobody waits for the others.
                let control = control.clone();
                tokio::spawn(async move {
                    while let Some(other) = attempts.join_next().await {
                        if let Ok(Attempt::Granted(other)) = other {
                            let (keys, channel) = (&other.keys, &other.channel);
                            leave(&control, keys, channel, other.granted.lease).await;
                        }
                    }
                });
                return Attempt::Granted(grant);
            }
            Ok(refused @ Attempt::Refused(_)) => best = refused,
            Ok(hearsay @ Attempt::Hearsay(_)) if matches!(best, Attempt::Silence) => best = hearsay,
            _ => {}
        }
    }
    best
}

/// Challenges that were given, and what is known if none was.
async fn challenges(
    control: &Session,
    keys: &SessionKeys,
    target: &JoinTarget,
) -> (Vec<Challenge>, Attempt) {
    let mut challenges: Vec<Challenge> = Vec::new();
    let mut said = Attempt::Silence;
    let question = ChallengeRequest {
        protocol: target.request.protocol,
    };
    let Some(mut replies) = Replies::to(control, &keys.challenge(), &question).await else {
        return (challenges, said);
    };
    let mut until = Instant::now() + JOIN_TIMEOUT;
    while let Ok(Some(reply)) = timeout_at(until, replies.next::<ChallengeReply>()).await {
        match reply {
            Ok(ChallengeReply::Given { needs_token, .. })
                if needs_token && target.token.is_none() =>
            {
                said = Attempt::Hearsay(JoinError::Refused {
                    code: RefusalCode::TokenRequired,
                    reason: "this server wants a token: give one with --token".to_owned(),
                });
            }
            Ok(ChallengeReply::Given { challenge, .. }) => {
                challenges.push(Challenge::from_bytes(challenge));
                until = until.min(Instant::now() + MORE_CHALLENGES);
            }
            Ok(ChallengeReply::Refused { code, reason }) => {
                said = Attempt::Hearsay(JoinError::Refused { code, reason });
            }
            Err(reason) => said = Attempt::Hearsay(unusable(reason)),
        }
        if challenges.len() == MOST_SERVERS {
            break;
        }
    }
    (challenges, said)
}

/// Answers one challenge.
async fn try_to_join(
    control: Session,
    keys: SessionKeys,
    target: JoinTarget,
    challenge: Challenge,
) -> Attempt {
    let secret = target
        .token
        .as_deref()
        .map_or(Secret::none(), Secret::of_token);
    let key = keys.join();
    let context = Context {
        key: &key,
        challenge: &challenge,
    };
    let request = json(&target.request);
    let (mut asking, message) = Asking::begin(&secret, context, &request);
    let join = SealedJoin {
        challenge: *challenge.as_bytes(),
        message,
        invite: target.invite,
    };
    let Some(mut replies) = Replies::to(&control, &key, &join).await else {
        return Attempt::Silence;
    };
    let mut said = Attempt::Silence;
    while let Some(reply) = replies.next::<SealedReply>().await {
        match reply {
            Ok(SealedReply::Answered { message }) => match asking.conclude(&message) {
                Ok((reply, channel_keys)) => {
                    let channel = Arc::new(Channel::of_handle(&channel_keys));
                    return accept(&control, keys, &reply, channel).await;
                }
                Err(_) => {
                    let reason = "it was given by somebody who does not know the token".to_owned();
                    said = Attempt::Hearsay(unusable(reason));
                }
            },
            Ok(SealedReply::Refused { code, reason }) => {
                said = Attempt::Hearsay(JoinError::Refused { code, reason });
            }
            Err(reason) => said = Attempt::Hearsay(unusable(reason)),
        }
    }
    said
}

/// What the server's own answer comes to.
async fn accept(
    control: &Session,
    keys: SessionKeys,
    reply: &[u8],
    channel: Arc<Channel>,
) -> Attempt {
    match parse::<JoinReply>(reply) {
        Ok(JoinReply::Granted(granted)) if !is_device_tick(granted.parameters.tick_s) => {
            leave(control, &keys, &channel, granted.lease).await;
            let tick_ms = granted.parameters.tick_s * 1e3;
            Attempt::Refused(unusable(format!(
                "its loop ticks every {tick_ms} ms, wanted 0.5 to 2 ms"
            )))
        }
        Ok(JoinReply::Granted(granted)) => Attempt::Granted(Box::new(JoinGrant {
            keys,
            granted: *granted,
            channel,
        })),
        Ok(JoinReply::Refused { code, reason, .. }) => {
            Attempt::Refused(JoinError::Refused { code, reason })
        }
        Err(error) => Attempt::Refused(unusable(error.to_string())),
    }
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

/// The answers to one question, in the order they come. None comes when the link breaks or nobody is there.
struct Replies(FifoChannelHandler<Reply>);

impl Replies {
    async fn to(session: &Session, key: &str, question: &impl Serialize) -> Option<Self> {
        let replies = session
            .get(key)
            .payload(json(question))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(JOIN_TIMEOUT)
            .await;
        replies.ok().map(Self)
    }

    async fn next<T>(&mut self) -> Option<Result<T, String>>
    where
        T: DeserializeOwned + Serialize + Validate,
    {
        while let Ok(reply) = self.0.recv_async().await {
            // Zenoh itself answers with an error when the time is over, and servers never do: either way nobody said
            // anything.
            let Ok(sample) = reply.result() else { continue };
            let payload = sample.payload();
            return Some(if LONGEST_ANSWER < payload.len() {
                Err(format!(
                    "it has {} bytes, want {LONGEST_ANSWER} at most",
                    payload.len()
                ))
            } else {
                parse(&payload.to_bytes()).map_err(|error| error.to_string())
            });
        }
        None
    }
}

fn json(question: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(question).expect("requests have no maps and no values that JSON lacks")
}

fn unusable(reason: String) -> JoinError {
    JoinError::Unusable { reason }
}
