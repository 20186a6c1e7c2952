//! Both Zenoh sessions, which others may take the place of: Zenoh reads its certificate once, so that whoever shows a
//! new one listens anew.

use std::sync::Arc;
use std::time::Duration;

use teleclay_doors::Identity;
use teleclay_proto::RealmName;
use teleclay_shell::Clock;
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::network::{Endpoints, NetworkError, Permissions, Rule, open};
use tokio::sync::watch;
use tokio::time::{interval, sleep, timeout};

use super::frames::hear_sessions;
use super::publish::{publish_bricks, publish_state, show_sessions};
use super::queries::{Line, answer_queries};
use super::sessions::Sessions;
use super::{guests, rules};
use crate::directory::Directory;
use crate::doors::Way;
use crate::doors::certificates::When;

/// Every line is down for a moment when another certificate is shown, so that waits until nobody holds a tool by Zenoh,
/// but no longer than this.
const AT_THE_LATEST: Duration = Duration::from_secs(3600);
/// Whether somebody does is looked at this often.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// A port is free again once the last of those who were on it is gone; it is tried again this often.
const TRY_EVERY: Duration = Duration::from_millis(50);

/// Where is listened.
#[derive(Clone)]
pub(super) struct Place {
    pub(super) realm: RealmName,
    pub(super) control: Endpoint,
    pub(super) slow: Endpoint,
    pub(super) directory: Directory,
    pub(super) clock: Clock,
}

impl Place {
    /// Opens both sessions and serves on them what needs no more than them.
    async fn listen(&self, identity: Option<&Identity>) -> Result<Sessions, NetworkError> {
        let identity = identity.map(|shown| (shown.chain_pem.clone(), shown.key_pem.clone()));
        let listen = |endpoint: &Endpoint, rules: Vec<Rule>| Endpoints {
            identity: identity.clone(),
            permissions: Permissions::Only(rules),
            ..Endpoints::listening(endpoint.clone())
        };
        let control = open(&listen(&self.control, rules::of_control(&self.realm))).await?;
        let slow = match open(&listen(&self.slow, rules::of_slow(&self.realm))).await {
            Ok(slow) => slow,
            Err(error) => {
                // The port is wanted again; what is wrong is said once, below.
                control.close().await.ok();
                return Err(error);
            }
        };
        let sessions = Sessions { control, slow };
        match self.serve(&sessions).await {
            Ok(()) => Ok(sessions),
            Err(error) => {
                sessions.close().await;
                Err(NetworkError::Open {
                    what: self.control.to_string(),
                    reason: error.to_string(),
                })
            }
        }
    }

    async fn serve(&self, sessions: &Sessions) -> Result<(), zenoh::Error> {
        let Self {
            realm, directory, ..
        } = self;
        let Sessions { control, slow } = sessions;
        let frames = hear_sessions(
            control.clone(),
            realm.clone(),
            directory.clone(),
            self.clock,
        );
        tokio::spawn(frames);
        for (session, line) in [(control, Line::Control), (slow, Line::Slow)] {
            answer_queries(session, realm, directory.clone(), line).await?;
        }
        tokio::spawn(guests::let_go_of_guests(control.clone(), directory.clone()));
        // Subscribers show no token, so where one is needed there is nothing to subscribe to.
        if !directory.doors().needs_token() {
            let state = publish_state(slow.clone(), realm.clone(), directory.clone());
            let bricks = publish_bricks(slow.clone(), realm.clone(), directory.clone());
            tokio::spawn(state);
            tokio::spawn(bricks);
        }
        let sessions = show_sessions(slow.clone(), realm.clone(), directory.clone());
        tokio::spawn(sessions);
        Ok(())
    }
}

/// The sessions, and how to come by others.
#[derive(Clone)]
pub(crate) struct Listening {
    place: Arc<Place>,
    sessions: Arc<watch::Sender<Sessions>>,
}

impl Listening {
    pub(super) async fn begin(
        place: Place,
        identity: Option<&Identity>,
    ) -> Result<Self, NetworkError> {
        let sessions = place.listen(identity).await?;
        Ok(Self {
            place: Arc::new(place),
            sessions: Arc::new(watch::Sender::new(sessions)),
        })
    }

    pub(super) fn sessions(&self) -> watch::Receiver<Sessions> {
        self.sessions.subscribe()
    }

    pub(super) async fn close(&self) {
        let sessions = self.sessions.borrow().clone();
        sessions.close().await;
    }

    /// Shows each certificate that comes, at once or when nobody holds a tool by Zenoh.
    pub(crate) async fn follow(self, mut shown: watch::Receiver<Option<(Identity, When)>>) {
        let Place { control, slow, .. } = &*self.place;
        if !(control.protocol.is_secure() || slow.protocol.is_secure()) {
            // In the clear nothing is shown.
            return;
        }
        while shown.changed().await.is_ok() {
            let newest = shown.borrow_and_update().clone();
            let Some((identity, when)) = newest else {
                continue;
            };
            if when == When::Free {
                let free = timeout(AT_THE_LATEST, self.until_it_is_free());
                tokio::select! {
                    _ = free => {}
                    _ = shown.changed() => {
                        // Another takes its place.
                        shown.mark_changed();
                        continue;
                    }
                }
            }
            self.renew(&identity).await;
        }
    }

    /// Shows this certificate from now on. Whoever holds a tool by Zenoh is let go of, by the ramp, and goes on.
    pub(crate) async fn renew(&self, identity: &Identity) {
        self.close().await;
        let mut is_told = false;
        let sessions = loop {
            match self.place.listen(Some(identity)).await {
                Ok(sessions) => break sessions,
                Err(error) if !is_told => {
                    tracing::warn!(%error, "handles cannot connect yet");
                    is_told = true;
                }
                Err(_) => {}
            }
            sleep(TRY_EVERY).await;
        };
        self.sessions.send_replace(sessions);
        tracing::info!("handles see the new certificate");
    }

    async fn until_it_is_free(&self) {
        let mut looks = interval(LOOK_EVERY);
        loop {
            looks.tick().await;
            let lives = self.place.directory.lives();
            let is_held = lives.iter().any(|live| {
                let connected = live.state().tools.into_iter().map(|tool| tool.connected);
                let by_zenoh = |(slot, connected): (usize, bool)| {
                    let holder = live.channels().at(slot).filter(|_| connected);
                    holder.is_some_and(|holder| matches!(holder.way, Way::Zenoh))
                };
                connected.enumerate().any(by_zenoh)
            });
            if !is_held {
                return;
            }
        }
    }
}
