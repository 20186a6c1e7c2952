//! `/sessions/{id}/stream`: a session as it happens, over one WebSocket with the subprotocol `teleclay.v1`.
//!
//! | part | does |
//! |---|---|
//! | this file | the handshake: who may watch, and how many |
//! | [`watcher`] | one open socket: what is sent when, what is answered |
//! | [`ear`] | what is heard meanwhile: frames of a hand, and a stop |
//! | [`hand`], [`operate`] | a tool that is held on a socket, and what else operators ask |
//! | [`answer`] | what is said to whoever has asked |
//! | [`bricks`] | which bricks a watcher still lacks |
//! | [`telemetry`] | samples into batches |
//! | [`pace`] | how fast a socket is heard |
//!
//! Nothing queues for a watcher. Telemetry waits in a ring of fixed length that forgets its oldest, bricks wait in the
//! clay itself, state is read when it is sent, and one message at a time is on its way. What holds for every socket
//! stands in [`socket`](super::socket).

mod answer;
mod bricks;
mod ear;
mod hand;
mod operate;
mod pace;
mod telemetry;
mod watcher;

use std::sync::Arc;

use axum::Extension;
use axum::extract::State;
use axum::extract::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::http::HeaderMap;
use axum::response::Response;
use teleclay_front::Peer;
use teleclay_proto::SUBPROTOCOL;
use teleclay_proto::watch::{MAX_FRAMES_MESSAGE, MAX_MESSAGE};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use self::watcher::Watcher;
use super::body::Found;
use super::guard::subprotocols;
use super::http_metrics::Watching;
use super::openapi::refusals;
use super::problem::{
    Failure, HANDSHAKE, NO_SUCH_SESSION, PATH, SESSION_DAMAGED, SUBPROTOCOL as NO_SUBPROTOCOL,
    TOO_MANY_WATCHERS, UPGRADE,
};
use super::socket::{READ_BUFFER, WRITE_BUFFER, refuse_handshake};
use super::watchers::MAX_WATCHERS_OF_ONE;
use super::{Api, MAX_WATCHERS};
use crate::doors::Pass;

/// Longest message of a hand.
const MAX_FROM_A_HAND: usize = MAX_FRAMES_MESSAGE;

/// The call of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new().routes(routes!(watch))
}

refusals!(WatchRefusals: HANDSHAKE, NO_SUBPROTOCOL, PATH, NO_SUCH_SESSION, SESSION_DAMAGED, UPGRADE, TOO_MANY_WATCHERS);

/// Watch a session, and change it, over a WebSocket
///
/// Ask for the subprotocol `teleclay.v1`. Text messages are JSON: `ServerText` from the server, `ClientText` to it, at
/// most 16 KiB. Binary messages are bricks of the clay, batches of telemetry, and frames of a hand that has joined. The
/// server says `hello`, then tells the state several times a second; bricks and telemetry come once a `subscribe` asks
/// for them, and bricks where a hand asks for a snapshot. A message that is not acceptable is answered with a `problem`
/// and nothing of it is done; a `stop` is acceptable whatever is wrong with it.
///
/// What is subscribed to costs at most 2 Mbit/s; frames and snapshots of a hand come on top. One that reads slowly gets
/// merged bricks and loses old telemetry, which is counted. The server closes with 4404 when the session has ended,
/// with 4408 when a message could not be handed over within ten seconds or pings were not answered for 25, with 1009
/// when a message is too long, with 1002 or 1007 when one breaks the protocol, with 4403 when the invite has ended that
/// it was opened with. A `problem` comes before 1009 and 1007.
#[utoipa::path(
    get, path = "/sessions/{id}/stream", tag = "watching",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("Sec-WebSocket-Protocol" = String, Header, description = "teleclay.v1, and bearer.<token> where a token is needed"),
    ),
    responses((status = 101, description = "The socket is open"), WatchRefusals),
)]
async fn watch(
    State(api): State<Api>,
    Found { id, live }: Found,
    Extension(pass): Extension<Pass>,
    peer: Option<Extension<Peer>>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Failure> {
    let upgrade = upgrade.map_err(|rejection| refuse_handshake(&rejection))?;
    if !subprotocols(&headers).any(|offered| offered == SUBPROTOCOL) {
        return Err(NO_SUBPROTOCOL.because(format!(
            "Sec-WebSocket-Protocol does not name {SUBPROTOCOL}"
        )));
    }
    let place = Arc::clone(api.watcher_places())
        .try_acquire_owned()
        .map_err(|_| {
            TOO_MANY_WATCHERS.because(format!("at most {MAX_WATCHERS} streams are open at once"))
        })?;
    let peer = peer.map(|Extension(peer)| peer);
    let from = api.watchers().enter(peer.map(|Peer(address)| address));
    let from = from.ok_or_else(|| {
        TOO_MANY_WATCHERS.because(format!(
            "at most {MAX_WATCHERS_OF_ONE} streams are open from one address at once"
        ))
    })?;
    let watching = Watching::begin(api.clone(), id.clone());
    Ok(upgrade
        .protocols([SUBPROTOCOL])
        .max_message_size(MAX_FROM_A_HAND)
        .max_frame_size(MAX_FROM_A_HAND)
        .read_buffer_size(READ_BUFFER)
        .write_buffer_size(WRITE_BUFFER)
        .max_write_buffer_size(WRITE_BUFFER + 2 * MAX_MESSAGE)
        .on_upgrade(async move |socket| {
            let end = Watcher::new(api.clone(), id.clone(), live, pass, peer)
                .serve(socket)
                .await;
            tracing::debug!(session = %id, reason = end.word(), "stream ended");
            api.metrics().count_ended(end.word());
            drop((watching, place, from));
        }))
}
