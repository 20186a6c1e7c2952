//! `/foxglove`: every session as Foxglove and Lichtblick show it, over one WebSocket.
//!
//! | part | does |
//! |---|---|
//! | this file | the handshake: who may look, and how many |
//! | [`visit`] | one open socket: what is sent when, what is answered |
//! | [`line`] | its sending half |
//! | [`followed`] | a session: its channels, what is told on them |
//! | [`services`] | what may be asked of a session |
//! | [`trail`] | how far behind a client is |
//!
//! The protocol and what waits for a client are [`teleclay_foxglove`]'s, the messages [`teleclay_ros`]'s. Tokens,
//! origins and places are those of the streams of sessions; whoever was invited to a session sees that one.

mod followed;
mod line;
mod services;
mod trail;
mod visit;

use std::sync::Arc;

use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Query, State, WebSocketUpgrade};
use axum::http::HeaderMap;
use axum::response::Response;
use axum::routing::get;
use axum::{Extension, Router};
use serde::Deserialize;
use teleclay_foxglove::SUBPROTOCOLS;
use teleclay_foxglove::connection::Rate;
use teleclay_front::Peer;
use teleclay_proto::http::FieldError;

use self::visit::Visit;
use super::guard::subprotocols;
use super::http_metrics::Visiting;
use super::problem::{Failure, SUBPROTOCOL as NO_SUBPROTOCOL, TOO_MANY_WATCHERS};
use super::socket::{MAX_INCOMING, READ_BUFFER, WRITE_BUFFER, refuse_handshake};
use super::watchers::MAX_WATCHERS_OF_ONE;
use super::{Api, MAX_WATCHERS};
use crate::doors::Pass;

/// Longest message to a client, bytes: a description of 32 channels.
const MAX_OUTGOING: usize = 512 * 1024;

/// The call of this module. It is not described beside those of `/api/v1`: the protocol is somebody else's, and
/// described there.
pub(crate) fn routes() -> Router<Api> {
    Router::new().route("/foxglove", get(open))
}

/// How often samples are to come, where a client does not say it topic by topic.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    rate_hz: Option<f64>,
}

async fn open(
    State(api): State<Api>,
    Extension(pass): Extension<Pass>,
    peer: Option<Extension<Peer>>,
    headers: HeaderMap,
    asked: Result<Query<Asked>, axum::extract::rejection::QueryRejection>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Failure> {
    let upgrade = upgrade.map_err(|rejection| refuse_handshake(&rejection))?;
    if !subprotocols(&headers).any(|offered| SUBPROTOCOLS.contains(&offered)) {
        let [newer, older] = SUBPROTOCOLS;
        return Err(NO_SUBPROTOCOL.because(format!(
            "Sec-WebSocket-Protocol names neither {newer} nor {older}"
        )));
    }
    let field = |detail: String| FieldError::new("/rate_hz", detail);
    let Query(Asked { rate_hz }) = asked.map_err(|rejection| field(rejection.body_text()))?;
    let rate = rate_hz.map_or(Ok(Rate::USUAL), Rate::new);
    let rate = rate.map_err(|error| field(error.to_string()))?;
    let place = Arc::clone(api.watcher_places())
        .try_acquire_owned()
        .map_err(|_| {
            TOO_MANY_WATCHERS.because(format!("at most {MAX_WATCHERS} streams are open at once"))
        })?;
    let from = peer.map(|Extension(Peer(address))| address);
    let from = api.watchers().enter(from).ok_or_else(|| {
        TOO_MANY_WATCHERS.because(format!(
            "at most {MAX_WATCHERS_OF_ONE} streams are open from one address at once"
        ))
    })?;
    let visiting = Visiting::begin(api.clone());
    Ok(upgrade
        .protocols(SUBPROTOCOLS)
        .max_message_size(MAX_INCOMING)
        .max_frame_size(MAX_INCOMING)
        .read_buffer_size(READ_BUFFER)
        .write_buffer_size(WRITE_BUFFER)
        .max_write_buffer_size(WRITE_BUFFER + 2 * MAX_OUTGOING)
        .on_upgrade(async move |socket| {
            let end = Visit::new(api.clone(), pass, rate).serve(socket).await;
            tracing::debug!(reason = end.word(), "a visit by Foxglove's protocol ended");
            api.metrics().count_ended(end.word());
            drop((visiting, place, from));
        }))
}
