//! Where the server is, and what it is known by: looked at before Zenoh is opened, and again while nobody answers.

use std::time::Duration;

use teleclay_proto::invite::Fingerprint;
use teleclay_shell::certificate::{ProbeError, trusted};
use teleclay_shell::endpoint::Endpoint;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep};

/// Between two looks at a server that does not answer.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// A server that was there is looked at again after so long a silence.
const LOOK_AFTER: Duration = Duration::from_secs(2);

/// The way to a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Door {
    /// Where it is.
    pub endpoint: Endpoint,
    /// What one of the certificates that it shows is known by; where there is none, a public authority must vouch for
    /// it. Endpoints in the clear have no certificate.
    pub fingerprint: Option<Fingerprint>,
}

impl Door {
    /// Waits until somebody is there, and gives the certificate in PEM that Zenoh is to trust, if that must be told.
    /// `on_absence` is called once, when nobody is.
    ///
    /// # Errors
    /// Whoever is there must not be spoken to.
    pub(crate) async fn wait(
        &self,
        on_absence: impl FnOnce(),
    ) -> Result<Option<String>, ProbeError> {
        let mut on_absence = Some(on_absence);
        loop {
            match trusted(&self.endpoint, self.fingerprint).await {
                Err(ProbeError::Unreachable { .. }) => {
                    if let Some(tell) = on_absence.take() {
                        tell();
                    }
                    sleep(LOOK_EVERY).await;
                }
                done => return done,
            }
        }
    }
}

/// Looks, while nobody answers on a line that was open before, whether it is the certificate's fault: Zenoh would try
/// again and again without a word.
pub(crate) struct Lookout {
    door: Door,
    silent_since: Instant,
    looking: Option<JoinHandle<Result<Option<String>, ProbeError>>>,
}

impl Lookout {
    pub(crate) fn new(door: Door) -> Self {
        Self {
            door,
            silent_since: Instant::now(),
            looking: None,
        }
    }

    /// Somebody has answered.
    pub(crate) fn on_heard(&mut self) {
        self.silent_since = Instant::now();
    }

    /// Nobody has.
    ///
    /// # Errors
    /// Somebody is there who must not be spoken to.
    pub(crate) async fn on_silence(&mut self) -> Result<(), ProbeError> {
        match self.looking.take_if(|looking| looking.is_finished()) {
            Some(looked) => {
                self.silent_since = Instant::now();
                // A look that was broken off says nothing; nor does an absence that is known already.
                match looked.await {
                    Ok(Err(error @ ProbeError::Unacceptable { .. })) => Err(error),
                    _ => Ok(()),
                }
            }
            None => {
                let is_time = LOOK_AFTER < self.silent_since.elapsed();
                if is_time && self.looking.is_none() && self.door.endpoint.protocol.is_secure() {
                    let door = self.door.clone();
                    let look = async move { trusted(&door.endpoint, door.fingerprint).await };
                    self.looking = Some(tokio::spawn(look));
                }
                Ok(())
            }
        }
    }
}
