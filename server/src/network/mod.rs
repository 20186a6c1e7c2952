//! Zenoh: frames in and out on one session, everything slow on another.
//!
//! | module | does |
//! |---|---|
//! | `frames` | frames, from the network to the tick and from the tick to the network |
//! | `guests` | what becomes of those who lose their tool |
//! | `listening` | both sessions, and others in their place when another certificate is shown |
//! | `queries` | what is asked |
//! | `publish` | what is told without being asked, where everybody may know it |
//! | `sessions` | the two that are open at the moment |
//! | `rules` | what Zenoh itself lets others do |

mod frames;
mod guests;
mod listening;
mod publish;
mod queries;
mod rules;
mod sessions;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use teleclay_doors::Identity;
use teleclay_proto::RealmName;
use teleclay_shell::Clock;
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::network::NetworkError;

use crate::directory::Directory;

pub(crate) use frames::{FedSender, Sender};
pub(crate) use listening::Listening;
pub(crate) use publish::whole;

use frames::Sending;
use listening::Place;

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
    listening: Listening,
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
        let place = Place {
            realm: realm.clone(),
            control: lines.control.clone(),
            slow: lines.slow.clone(),
            directory: directory.clone(),
            clock,
        };
        let listening = Listening::begin(place, lines.identity).await?;
        if let Some(departed) = directory.departed() {
            tokio::spawn(guests::say_farewells(
                listening.sessions(),
                realm.clone(),
                departed,
            ));
        }
        let FedSender { sender, outgoing } = sender;
        let sending = Sending {
            outgoing,
            sessions: listening.sessions(),
            realm: realm.clone(),
            directory: directory.clone(),
        };
        // Fails only if the thread is gone; then nothing would be sent, and readiness would say so.
        let is_sending = sender.start.send(sending).is_ok();
        if is_sending {
            directory.set_zenoh_up();
        }
        Ok(Self {
            listening,
            stop: sender.stop,
            sender: Some(sender.thread),
        })
    }

    pub(crate) fn listening(&self) -> &Listening {
        &self.listening
    }

    /// Closes both sessions and ends the sender.
    pub async fn close(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(sender) = self.sender.take() {
            sender.thread().unpark();
            // A panic was printed by the thread itself.
            let _ = tokio::task::spawn_blocking(move || sender.join()).await;
        }
        self.listening.close().await;
    }
}

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain data has a JSON form")
}
