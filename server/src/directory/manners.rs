//! Manners among operators, and the stop: what a session is asked for them. Who may ask is checked before.

use teleclay_proto::http::Session;
use teleclay_session::{Command, Prepared};

use super::{ChangeError, Live};

/// What somebody wants of a tool.
#[derive(Clone, Debug)]
pub(crate) enum Control {
    Request { operator: String },
    Withdraw { operator: String },
    Grant { operator: String },
    Deny { operator: String, reason: String },
    Release,
}

impl Control {
    /// What the audit log calls it.
    pub(crate) const fn word(&self) -> &'static str {
        match self {
            Self::Request { .. } => "request",
            Self::Withdraw { .. } => "withdraw",
            Self::Grant { .. } => "grant",
            Self::Deny { .. } => "deny",
            Self::Release => "release",
        }
    }
}

impl Live {
    /// Stops the session. It waits for no other change.
    ///
    /// # Errors
    /// The session is gone, or the loop does not answer: then nothing moves, either.
    pub(crate) async fn stop(&self, by: &str, reason: &str) -> Result<Session, ChangeError> {
        self.at_once(Prepared::stop(by, reason)).await
    }

    /// Carries out what no setting matters to: it waits for no change that is being prepared.
    async fn at_once(&self, prepared: Prepared) -> Result<Session, ChangeError> {
        let outcome = self.command(prepared, None).await?;
        Ok(Session {
            revision: outcome.revision,
            ..self.state()
        })
    }

    /// Takes a tool from its holder, who says goodbye.
    ///
    /// # Errors
    /// Nobody holds the lease, the session is gone, or the loop does not answer.
    pub(crate) async fn leave(&self, lease: u32) -> Result<(), ChangeError> {
        let prepared = Prepared::new(&Command::Leave { lease }, &self.settings())?;
        self.command(prepared, None).await.map(drop)
    }

    /// Lets tools be taken again.
    ///
    /// # Errors
    /// The session is not stopped or gone, or the loop does not answer.
    pub(crate) async fn clear_stop(&self, by: String) -> Result<Session, ChangeError> {
        let prepared = Prepared::new(&Command::ClearStop { by }, &self.settings())?;
        self.at_once(prepared).await
    }

    /// Has done with a tool what somebody wants; with a `lease`, what its holder wants.
    ///
    /// # Errors
    /// There is no such tool, or it is not as the asker thinks; the session is gone, or the loop does not answer.
    pub(crate) async fn control(
        &self,
        tool: u32,
        control: Control,
        lease: Option<u32>,
    ) -> Result<Session, ChangeError> {
        let command = match control {
            Control::Request { operator } => Command::Request { tool, operator },
            Control::Withdraw { operator } => Command::Withdraw { tool, operator },
            Control::Grant { operator } => Command::Grant {
                tool,
                operator,
                lease,
            },
            Control::Deny { operator, reason } => Command::Deny {
                tool,
                operator,
                reason,
                lease,
            },
            Control::Release => Command::Release { tool, lease },
        };
        self.at_once(Prepared::new(&command, &self.settings())?)
            .await
    }
}
