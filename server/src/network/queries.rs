//! What is asked on Zenoh, and the answers.

use teleclay_proto::http::{ClayReset, parse};
use teleclay_proto::join::{
    FreshReply, FreshRequest, JoinReply, JoinRequest, LeaveReply, LeaveRequest, RefusalCode,
};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_proto::{RealmName, SessionId};
use zenoh::Session;
use zenoh::bytes::ZBytes;
use zenoh::query::Query;

use super::publish::bricks;
use crate::directory::Directory;

/// Longer questions are not read: a join has a hundredth of it.
const LONGEST_QUESTION: usize = 16 * 1024;

pub(super) async fn answer_queries(
    session: &Session,
    realm: &RealmName,
    directory: Directory,
) -> Result<(), zenoh::Error> {
    let runtime = tokio::runtime::Handle::current();
    let realm = realm.clone();
    session
        .declare_queryable(keys::everything_in(&realm))
        .callback(move |query: Query| {
            let (directory, realm) = (directory.clone(), realm.clone());
            runtime.spawn(async move { answer(&query, &realm, &directory).await });
        })
        .background()
        .await
}

async fn answer(query: &Query, realm: &RealmName, directory: &Directory) {
    let Ok(Key {
        session: keys,
        leaf,
    }) = query.key_expr().as_str().parse::<Key>()
    else {
        return;
    };
    if keys.realm() != realm {
        return;
    }
    let id = keys.session();
    let payload = match question(query.payload()) {
        Ok(payload) => payload,
        Err(bytes) => {
            let reason = format!("{bytes} bytes, wanted {LONGEST_QUESTION} at most");
            tracing::debug!(key = %query.key_expr(), "a question of {reason}");
            let reply = match leaf {
                Leaf::Join => json(&JoinReply::Refused {
                    code: RefusalCode::BadRequest,
                    reason,
                }),
                Leaf::ClayFresh => json(&FreshReply::Refused { reason }),
                _ => return,
            };
            return reply_with(query, &keys, leaf, reply).await;
        }
    };
    let reply = match leaf {
        Leaf::Join => json(&join(id, &payload, directory).await),
        Leaf::Leave => json(&leave(id, &payload, directory).await),
        Leaf::ClayFresh => json(&fresh(id, &payload, directory).await),
        Leaf::Parameters => match directory.session(id) {
            Some(live) => json(&live.loop_parameters()),
            None => return,
        },
        Leaf::ClaySnapshot => match directory.session(id) {
            Some(live) => {
                for message in bricks(&live, None).0 {
                    reply_with(query, &keys, leaf, message).await;
                }
                return;
            }
            None => return,
        },
        Leaf::State => match directory.session(id) {
            Some(live) => json(&live.state()),
            None => return,
        },
        _ => return,
    };
    reply_with(query, &keys, leaf, reply).await;
}

/// What a query brings, copied only where it is no longer than any question here may be; else its length in bytes.
fn question(payload: Option<&ZBytes>) -> Result<Vec<u8>, usize> {
    match payload {
        None => Ok(Vec::new()),
        Some(bytes) if LONGEST_QUESTION < bytes.len() => Err(bytes.len()),
        Some(bytes) => Ok(bytes.to_bytes().into_owned()),
    }
}

async fn reply_with(query: &Query, keys: &SessionKeys, leaf: Leaf, payload: Vec<u8>) {
    if let Err(error) = query.reply(keys.key(leaf), payload).await {
        tracing::warn!(%error, "a query could not be answered");
    }
}

pub(super) fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain data has a JSON form")
}

async fn join(id: &SessionId, payload: &[u8], directory: &Directory) -> JoinReply {
    let request: JoinRequest = match parse(payload) {
        Ok(request) => request,
        Err(error) => {
            return JoinReply::Refused {
                code: RefusalCode::BadRequest,
                reason: error.to_string(),
            };
        }
    };
    match directory.join(id, &request).await {
        Ok(granted) => JoinReply::Granted(Box::new(granted)),
        Err((code, reason)) => JoinReply::Refused { code, reason },
    }
}

async fn leave(id: &SessionId, payload: &[u8], directory: &Directory) -> LeaveReply {
    let (Ok(LeaveRequest { lease }), Some(live)) = (parse(payload), directory.session(id)) else {
        return LeaveReply::NoSuchLease;
    };
    match live.leave(lease).await {
        Ok(()) => LeaveReply::Left,
        Err(_) => LeaveReply::NoSuchLease,
    }
}

async fn fresh(id: &SessionId, payload: &[u8], directory: &Directory) -> FreshReply {
    let refused = |reason: &str| FreshReply::Refused {
        reason: reason.to_owned(),
    };
    let request: FreshRequest = match parse(payload) {
        Ok(request) => request,
        Err(error) => return refused(&error.to_string()),
    };
    let Some(live) = directory.session(id) else {
        return refused("there is no such session");
    };
    match live.reset(ClayReset::default(), Some(request.lease)).await {
        Ok(session) => FreshReply::Fresh {
            epoch: session.clay.epoch,
        },
        Err(error) => refused(&error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_that_is_too_long_is_not_copied() {
        let bytes = |length: usize| ZBytes::from(vec![b' '; length]);
        assert_eq!(question(None), Ok(Vec::new()));
        let longest = question(Some(&bytes(LONGEST_QUESTION)));
        assert_eq!(longest.map(|payload| payload.len()), Ok(LONGEST_QUESTION));
        assert_eq!(question(Some(&bytes(100_000_000))), Err(100_000_000));
    }
}
