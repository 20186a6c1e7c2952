//! What is asked on Zenoh, and the answers.
//!
//! An answer waits for whoever asked to read it, so every one is put by a thread that may wait, and only so many wait
//! at once. The session that frames fly on answers nothing that is long. Whoever lets a question go says so to its
//! asker, and waits likewise: a thread of its own does that, and none of Zenoh's as long as there is room, since those
//! carry every line.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use teleclay_channel::Purpose;
use teleclay_proto::http::{ClayReset, parse};
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, FreshReply, LeaveReply, RefusalCode, SealedJoin, SealedReply,
};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_proto::{Part, RealmName};
use tokio::sync::Semaphore;
use zenoh::bytes::ZBytes;
use zenoh::query::Query;
use zenoh::{Session, Wait};

use super::json;
use super::publish::whole;
use crate::directory::{Directory, Live};
use crate::doors::LeaseChannel;

/// Longer questions are not read: a join has a tenth of it.
const LONGEST_QUESTION: usize = 16 * 1024;
/// The end of a key on which the clay is asked for.
const SNAPSHOT: &str = "/clay/snapshot";
/// A question that has waited for so long is forgotten: whoever asked has given up.
const PATIENCE: Duration = Duration::from_secs(10);

/// Which of the server's two sessions is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// The one that frames fly on.
    Control,
    /// The other.
    Slow,
}

/// Questions of one kind: so many are worked on at once, so many have a place, and others are not heard. A question
/// that is worked on may wait for its asker to read, so kinds that strangers can hold up do not share with others.
struct Desk {
    turns: Semaphore,
    places: Arc<Semaphore>,
}

impl Desk {
    fn new(at_once: usize, places: usize) -> Self {
        Self {
            turns: Semaphore::new(at_once),
            places: Arc::new(Semaphore::new(places)),
        }
    }
}

/// Questions that wait to be let go of. An asker who reads nothing is waited for a second at most, and then its line is
/// closed.
const LET_GO_AT_ONCE: usize = 4096;
/// Zenoh's own thread lets go of a question when it has handed it over, and whoever lets go last says so to the asker:
/// that is to be somebody who may wait.
const LET_GO_AFTER: Duration = Duration::from_millis(100);
/// Of these, with a payload longer than a question may be.
const LONG_ONES_AT_ONCE: usize = 8;

/// The thread that lets go of questions.
struct Finisher {
    waiting: SyncSender<(Instant, Query)>,
    long_ones: SyncSender<(Instant, Query)>,
}

impl Finisher {
    fn spawn() -> std::io::Result<Self> {
        let start = |room| {
            let (waiting, received) = sync_channel::<(Instant, Query)>(room);
            let work = move || {
                for (since, query) in received {
                    std::thread::sleep(LET_GO_AFTER.saturating_sub(since.elapsed()));
                    drop(query);
                }
            };
            std::thread::Builder::new()
                .name("let-go".to_owned())
                .spawn(work)?;
            Ok::<_, std::io::Error>(waiting)
        };
        Ok(Self {
            waiting: start(LET_GO_AT_ONCE)?,
            long_ones: start(LONG_ONES_AT_ONCE)?,
        })
    }

    fn finish(&self, query: Query) {
        let length = query.payload().map_or(0, ZBytes::len);
        let way = if length <= LONGEST_QUESTION {
            &self.waiting
        } else {
            &self.long_ones
        };
        // One that finds no room is let go of here: whoever asks for so much is not read any faster.
        let _ = way.try_send((Instant::now(), query));
    }
}

/// A question that is let go of where that may take its time.
struct Held {
    query: Option<Query>,
    finisher: Arc<Finisher>,
}

impl Held {
    fn query(&self) -> &Query {
        self.query
            .as_ref()
            .expect("it goes only when this is dropped")
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        if let Some(query) = self.query.take() {
            self.finisher.finish(query);
        }
    }
}

/// What is needed for an answer.
struct Office {
    realm: RealmName,
    directory: Directory,
    line: Line,
    /// The whole clay, for whoever names no lease.
    looks: Desk,
    /// The whole clay, for holders of tools.
    snapshots: Desk,
    others: Desk,
}

impl Office {
    fn desk(&self, query: &Query) -> &Desk {
        let asks_for_clay = query.key_expr().as_str().ends_with(SNAPSHOT);
        match query.payload() {
            _ if !asks_for_clay => &self.others,
            Some(payload) if !payload.is_empty() => &self.snapshots,
            _ => &self.looks,
        }
    }
}

pub(super) async fn answer_queries(
    session: &Session,
    realm: &RealmName,
    directory: Directory,
    line: Line,
) -> Result<(), zenoh::Error> {
    let runtime = tokio::runtime::Handle::current();
    let finisher = Arc::new(Finisher::spawn()?);
    let office = Arc::new(Office {
        realm: realm.clone(),
        directory,
        line,
        looks: Desk::new(2, 16),
        snapshots: Desk::new(8, 32),
        others: Desk::new(8, 256),
    });
    session
        .declare_queryable(keys::everything_in(realm))
        .callback(move |query: Query| {
            let place = Arc::clone(&office.desk(&query).places).try_acquire_owned();
            let held = Held {
                query: Some(query),
                finisher: Arc::clone(&finisher),
            };
            let Ok(place) = place else {
                return;
            };
            let office = Arc::clone(&office);
            runtime.spawn(async move {
                let _ = tokio::time::timeout(PATIENCE, office.answer(held)).await;
                drop(place);
            });
        })
        .background()
        .await
}

/// A question under a lease or none, and what its answer is sealed with.
struct Asked {
    keys: SessionKeys,
    leaf: Leaf,
    payload: Vec<u8>,
}

impl Office {
    async fn answer(&self, held: Held) {
        let query = held.query();
        let Ok(Key {
            session: keys,
            leaf,
        }) = query.key_expr().as_str().parse::<Key>()
        else {
            return;
        };
        if keys.realm() != &self.realm {
            return;
        }
        let payload = match question(query.payload()) {
            Ok(payload) => payload,
            Err(bytes) => {
                let reason = format!("{bytes} bytes, wanted {LONGEST_QUESTION} at most");
                tracing::debug!(key = %query.key_expr(), "a question of {reason}");
                let code = RefusalCode::BadRequest;
                let reply = match leaf {
                    Leaf::Challenge => json(&ChallengeReply::Refused { code, reason }),
                    Leaf::Join => json(&SealedReply::Refused { code, reason }),
                    _ => return,
                };
                return self.reply(held, &keys.key(leaf), vec![reply]).await;
            }
        };
        let key = keys.key(leaf);
        let asked = Asked {
            keys,
            leaf,
            payload,
        };
        let Ok(_turn) = self.desk(query).turns.acquire().await else {
            return;
        };
        let parts = match leaf {
            Leaf::Challenge => vec![json(&self.challenge(&asked))],
            Leaf::Join => self.join(&key, &asked).await.iter().map(json).collect(),
            _ => self.under_lease(&asked).await,
        };
        self.reply(held, &key, parts).await;
    }

    fn challenge(&self, asked: &Asked) -> ChallengeReply {
        match parse::<ChallengeRequest>(&asked.payload) {
            Ok(request) => self.directory.challenge(asked.keys.session(), request),
            Err(error) => ChallengeReply::Refused {
                code: RefusalCode::BadRequest,
                reason: error.to_string(),
            },
        }
    }

    async fn join(&self, key: &str, asked: &Asked) -> Option<SealedReply> {
        match parse::<SealedJoin>(&asked.payload) {
            Ok(join) => self.directory.join(asked.keys.session(), key, &join).await,
            Err(error) => Some(SealedReply::Refused {
                code: RefusalCode::BadRequest,
                reason: error.to_string(),
            }),
        }
    }

    /// The parts of an answer to a question that only holders of a tool may ask; nothing for anybody else. Where no
    /// token is needed, everybody may look.
    async fn under_lease(&self, asked: &Asked) -> Vec<Vec<u8>> {
        let (Some(purpose), Some(live)) = (
            purpose(asked.leaf),
            self.directory.session(asked.keys.session()),
        ) else {
            return Vec::new();
        };
        if self.line == Line::Control && purpose != Purpose::Leave {
            return Vec::new();
        }
        let is_public = !self.directory.doors().needs_token();
        if asked.payload.is_empty() && is_public {
            return look(purpose, &live);
        }
        let Ok(asker) = live.asker(purpose, &asked.payload) else {
            return Vec::new();
        };
        match purpose {
            Purpose::Leave | Purpose::ClayFresh => {
                let did = if purpose == Purpose::Leave {
                    "leave"
                } else {
                    "fresh block"
                };
                let who = &asker.pass.who;
                let outcome = format!("lease {}", asker.lease);
                self.directory
                    .doors()
                    .tell(who, did, Some(live.id()), &outcome);
            }
            _ => {}
        }
        let parts = match purpose {
            Purpose::Leave => vec![json(&leave(&live, &asker).await)],
            Purpose::ClayFresh => vec![json(&fresh(&live, &asker).await)],
            _ => look(purpose, &live),
        };
        let parts = if purpose == Purpose::ClaySnapshot {
            numbered(&parts)
        } else {
            parts
        };
        let seal = |part: Vec<u8>| -> Vec<u8> {
            asker.channel.seal_answer(purpose, &asked.payload, &part)
        };
        parts.into_iter().map(seal).collect()
    }

    /// Hands the parts of an answer over. Blocks a thread that may block, for as long as the asker does not read.
    async fn reply(&self, held: Held, key: &str, parts: Vec<Vec<u8>>) {
        let key = key.to_owned();
        let replied = tokio::task::spawn_blocking(move || {
            for part in parts {
                held.query().reply(key.as_str(), part).wait()?;
            }
            Ok::<_, zenoh::Error>(())
        });
        // It is not joined only where the server ends.
        if let Ok(Err(error)) = replied.await {
            tracing::debug!(%error, "a query could not be answered");
        }
    }
}

/// What a question under a lease is sealed for, on each key.
fn purpose(leaf: Leaf) -> Option<Purpose> {
    match leaf {
        Leaf::Leave => Some(Purpose::Leave),
        Leaf::ClayFresh => Some(Purpose::ClayFresh),
        Leaf::Parameters => Some(Purpose::Parameters),
        Leaf::ClaySnapshot => Some(Purpose::ClaySnapshot),
        Leaf::State => Some(Purpose::State),
        _ => None,
    }
}

/// What can be seen without changing anything.
fn look(purpose: Purpose, live: &Live) -> Vec<Vec<u8>> {
    match purpose {
        Purpose::Parameters => vec![json(&live.loop_parameters())],
        Purpose::ClaySnapshot => whole(live).0,
        Purpose::State => vec![json(&live.state())],
        Purpose::Frame | Purpose::Leave | Purpose::ClayFresh => Vec::new(),
    }
}

/// Parts that say which of how many they are.
fn numbered(parts: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let count = parts.len() as u32;
    let number = |(index, content): (u32, &Vec<u8>)| {
        let part = Part {
            index,
            count,
            content,
        };
        part.encode()
    };
    (0..).zip(parts).map(number).collect()
}

/// What a query brings, copied only where it is no longer than any question here may be; else its length in bytes.
fn question(payload: Option<&ZBytes>) -> Result<Vec<u8>, usize> {
    match payload {
        None => Ok(Vec::new()),
        Some(bytes) if LONGEST_QUESTION < bytes.len() => Err(bytes.len()),
        Some(bytes) => Ok(bytes.to_bytes().into_owned()),
    }
}

async fn leave(live: &Live, asker: &LeaseChannel) -> LeaveReply {
    match live.leave(asker.lease).await {
        Ok(()) => LeaveReply::Left,
        Err(_) => LeaveReply::NoSuchLease,
    }
}

async fn fresh(live: &Live, asker: &LeaseChannel) -> FreshReply {
    match live.reset(ClayReset::default(), Some(asker.lease)).await {
        Ok(session) => FreshReply::Fresh {
            epoch: session.clay.epoch,
        },
        Err(error) => FreshReply::Refused {
            reason: error.to_string(),
        },
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
