//! Zenoh: frames in and out on one session, everything slow on another.
//!
//! | module | does |
//! |---|---|
//! | `frames` | frames, from the network to the tick and from the tick to the network |
//! | `guests` | what becomes of those who lose their tool |
//! | `queries` | what is asked |
//! | `publish` | what is told without being asked, where everybody may know it |
//! | `rules` | what Zenoh itself lets others do |

mod frames;
mod guests;
mod publish;
mod queries;
mod rules;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use teleclay_doors::Identity;
use teleclay_proto::RealmName;
use teleclay_shell::Clock;
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::network::{Endpoints, NetworkError, Permissions, Rule, open};
use zenoh::Session;

use crate::directory::Directory;

pub(crate) use frames::{FedSender, Sender};
pub(crate) use publish::bricks;

use frames::{Sending, receive_frames};
use publish::{publish_bricks, publish_state, show_sessions};
use queries::{Line, answer_queries};

/// Where the server listens for handles, and what it shows of itself there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lines<'a> {
    /// For frames.
    pub(crate) control: &'a Endpoint,
    /// For everything else.
    pub(crate) slow: &'a Endpoint,
    /// For endpoints that are encrypted.
    pub(crate) identity: Option<&'a Identity>,
}

/// The server's side of Zenoh. Dropping it closes nothing by itself: see [`Network::close`].
pub struct Network {
    control: Session,
    slow: Session,
    stop: Arc<AtomicBool>,
    sender: Option<JoinHandle<()>>,
}

impl Network {
    /// Opens both sessions and serves `directory` on them.
    ///
    /// # Errors
    /// An endpoint cannot be listened on.
    pub(crate) async fn open(
        realm: &RealmName,
        lines: Lines<'_>,
        directory: &Directory,
        sender: FedSender,
        clock: Clock,
    ) -> Result<Self, NetworkError> {
        let identity = lines
            .identity
            .map(|identity| (identity.chain_pem.clone(), identity.key_pem.clone()));
        let listen = |endpoint: &Endpoint, rules: Vec<Rule>| Endpoints {
            identity: identity.clone(),
            permissions: Permissions::Only(rules),
            ..Endpoints::listening(endpoint.clone())
        };
        let control = open(&listen(lines.control, rules::of_control(realm))).await?;
        let slow = open(&listen(lines.slow, rules::of_slow(realm))).await?;
        let failed = |reason: zenoh::Error| NetworkError::Open {
            what: lines.control.to_string(),
            reason: reason.to_string(),
        };

        receive_frames(&control, realm, directory.clone(), clock)
            .await
            .map_err(failed)?;
        for (session, line) in [(&control, Line::Control), (&slow, Line::Slow)] {
            answer_queries(session, realm, directory.clone(), line)
                .await
                .map_err(failed)?;
        }
        tokio::spawn(guests::let_go_of_guests(control.clone(), directory.clone()));
        if let Some(departed) = directory.departed() {
            tokio::spawn(guests::say_farewells(
                control.clone(),
                realm.clone(),
                departed,
            ));
        }
        // Subscribers show no token, so where one is needed there is nothing to subscribe to.
        let is_public = !directory.doors().needs_token();
        if is_public {
            tokio::spawn(publish_state(
                slow.clone(),
                realm.clone(),
                directory.clone(),
            ));
            tokio::spawn(publish_bricks(
                slow.clone(),
                realm.clone(),
                directory.clone(),
            ));
        }
        tokio::spawn(show_sessions(
            slow.clone(),
            realm.clone(),
            directory.clone(),
        ));
        let FedSender { sender, outgoing } = sender;
        let sending = Sending {
            outgoing,
            session: control.clone(),
            realm: realm.clone(),
            directory: directory.clone(),
        };
        // Fails only if the thread is gone; then nothing would be sent, and readiness would say so.
        let is_sending = sender.start.send(sending).is_ok();
        if is_sending {
            directory.set_zenoh_up();
        }
        Ok(Self {
            control,
            slow,
            stop: sender.stop,
            sender: Some(sender.thread),
        })
    }

    /// Closes both sessions and ends the sender.
    pub async fn close(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(sender) = self.sender.take() {
            sender.thread().unpark();
            // A panic was printed by the thread itself.
            let _ = tokio::task::spawn_blocking(move || sender.join()).await;
        }
        for session in [self.control, self.slow] {
            if let Err(error) = session.close().await {
                tracing::warn!(%error, "a zenoh session did not close cleanly");
            }
        }
    }
}

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain data has a JSON form")
}
