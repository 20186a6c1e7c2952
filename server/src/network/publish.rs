//! What is told without being asked: which sessions there are, their state, and the clay as it changes.

use std::collections::HashMap;
use std::time::Duration;

use teleclay_channel::TRAILER;
use teleclay_clay::{BrickView, Clay};
use teleclay_proto::keys::SessionKeys;
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickContent, BricksHeader, BricksKind, BricksWriter, MAX_MESSAGE, write_classes,
};
use teleclay_proto::{RealmName, SessionId};
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

use super::json;
use crate::directory::{Directory, Live};

/// How often slow state is published, and bricks at most.
const STATE_PERIOD: Duration = Duration::from_millis(500);
const BRICKS_PERIOD: Duration = Duration::from_millis(100);

/// Shows by a token which sessions this server runs. Handles let go at once when the token of theirs goes.
pub(super) async fn show_sessions(session: Session, realm: RealmName, directory: Directory) {
    let mut shown: HashMap<SessionId, LivelinessToken> = HashMap::new();
    let mut changes = directory.changes();
    loop {
        let lives = directory.lives();
        // A token that is dropped is undeclared.
        shown.retain(|id, _| lives.iter().any(|live| live.id() == id));
        for live in &lives {
            if shown.contains_key(live.id()) {
                continue;
            }
            let key = SessionKeys::new(realm.clone(), live.id().clone()).alive();
            match session.liveliness().declare_token(key).await {
                Ok(token) => {
                    shown.insert(live.id().clone(), token);
                }
                Err(error) => tracing::error!(%error, "a session cannot be shown on zenoh"),
            }
        }
        // The directory lives as long as this task does.
        if changes.changed().await.is_err() || session.is_closed() {
            return;
        }
    }
}

pub(super) async fn publish_state(session: Session, realm: RealmName, directory: Directory) {
    let mut period = tokio::time::interval(STATE_PERIOD);
    while !session.is_closed() {
        period.tick().await;
        for state in directory.sessions() {
            let key = SessionKeys::new(realm.clone(), state.id.clone()).state();
            // An error means that the session is closing.
            let _ = session.put(key, json(&state)).await;
        }
    }
}

pub(super) async fn publish_bricks(session: Session, realm: RealmName, directory: Directory) {
    let mut seen: HashMap<SessionId, (u32, u64)> = HashMap::new();
    let mut period = tokio::time::interval(BRICKS_PERIOD);
    while !session.is_closed() {
        period.tick().await;
        let ids: Vec<SessionId> = directory
            .sessions()
            .into_iter()
            .map(|session| session.id)
            .collect();
        seen.retain(|id, _| ids.contains(id));
        for id in ids {
            let Some(live) = directory.session(&id) else {
                continue;
            };
            let (messages, now) = bricks(&live, seen.get(&id).copied());
            seen.insert(id.clone(), now);
            let key = SessionKeys::new(realm.clone(), id).clay_bricks();
            for message in messages {
                // An error means that the session is closing.
                let _ = session.put(&key, message).await;
            }
        }
    }
}

/// The bricks that changed since `seen` (epoch and revision), or all of them, and what has been seen then.
pub(crate) fn bricks(live: &Live, seen: Option<(u32, u64)>) -> (Vec<Vec<u8>>, (u32, u64)) {
    live.clay().with(|clay, epoch| {
        let since = seen
            .filter(|(seen_epoch, _)| *seen_epoch == epoch)
            .map(|(_, revision)| revision);
        (write_bricks(clay, epoch, since), (epoch, clay.revision()))
    })
}

/// The clay at one moment, for whoever makes a copy of it: its classes of material, if it has more than one, then every
/// brick; and the epoch and the revision of it.
pub(crate) fn whole(live: &Live) -> (Vec<Vec<u8>>, (u32, u64)) {
    live.clay().with(|clay, epoch| {
        let longest = MAX_MESSAGE - TRAILER;
        let mut messages = clay.classes().map_or_else(Vec::new, |classes| {
            write_classes(classes.encoded(), epoch, 0, longest)
        });
        messages.extend(write_bricks(clay, epoch, None));
        (messages, (epoch, clay.revision()))
    })
}

fn write_bricks(clay: &Clay, epoch: u32, since: Option<u64>) -> Vec<Vec<u8>> {
    let grid = clay.grid();
    let header = BricksHeader {
        sequence: 0,
        clay_epoch: epoch,
        bricks_per_axis: grid.bricks(),
        kind: if since.is_none() {
            BricksKind::Keyframe
        } else {
            BricksKind::Delta
        },
        voxel_size_m: grid.voxel_size_m() as f32,
    };
    let mut writer = BricksWriter::new(header, MAX_MESSAGE - TRAILER);
    let mut write = |index: teleclay_clay::BrickIndex| {
        let content = match clay.brick(index) {
            BrickView::Empty => BrickContent::Empty,
            BrickView::Full => BrickContent::Full,
            BrickView::Voxels(voxels) => BrickContent::Voxels(voxels),
        };
        writer
            .push(index.as_u32(), content)
            .expect("the index is the grid's own");
    };
    match since {
        Some(revision) => clay.changed_after(revision).for_each(&mut write),
        None => (0..grid.brick_count() as u32)
            .filter_map(|dense| grid.brick_index(dense))
            .for_each(&mut write),
    }
    writer.finish()
}

const _: () = assert!(
    BRICK_VOXELS == teleclay_clay::BRICK_VOXELS,
    "bricks on the wire are the clay's"
);
