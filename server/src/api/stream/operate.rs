//! What somebody asks on a socket who holds a tool, or wants one.

use std::sync::Arc;
use std::time::Duration;

use teleclay_proto::http::NO_REASON;
use teleclay_proto::invite::Role;
use teleclay_proto::join::{ClayDescription, JoinRequest, RefusalCode};
use teleclay_proto::watch::{ClientText, ServerText};
use teleclay_proto::{PROTOCOL, SessionId};

use super::hand::Hand;
use super::watcher::{Answer, Change, problem};
use crate::api::guard::check_role;
use crate::api::manners::{check_decides, name_of};
use crate::api::problem::{Failure, NO_LEASE, OTHER_BLOCK};
use crate::api::sessions::change_failure;
use crate::api::{Api, see_through};
use crate::directory::{ChangeError, Control, Live, NotGranted};
use crate::doors::Pass;
use crate::network::bricks;

/// Whoever shows a wrong token waits for the answer, so that nobody tries many.
const AFTER_A_WRONG_TOKEN: Duration = Duration::from_secs(1);

/// Who asks.
pub(super) struct Asker<'a> {
    pub(super) api: &'a Api,
    pub(super) id: &'a SessionId,
    pub(super) live: &'a Live,
    pub(super) pass: &'a Pass,
}

/// What there is to do.
pub(super) enum Work {
    /// Nothing but to say this.
    Said(ServerText),
    /// To wait for this.
    Begun(Change),
}

impl Asker<'_> {
    /// Begins what was asked, of a socket that has this hand.
    ///
    /// # Errors
    /// It cannot be asked here.
    pub(super) fn work(&self, asked: ClientText, hand: &mut Option<Hand>) -> Result<Work, Failure> {
        match asked {
            ClientText::Join {
                operator,
                device,
                token,
            } => Ok(self.join(operator, device.name, token, hand)),
            ClientText::Leave {} => {
                let lease = held(hand.as_ref())?.lease();
                let (live, hand) = (self.live.clone(), hand.take());
                Ok(begun(async move {
                    // It may have ended meanwhile, which is as good.
                    live.leave(lease).await.ok();
                    drop(hand);
                    ServerText::Left {}.into()
                }))
            }
            ClientText::Parameters {} => {
                held(hand.as_ref())?;
                Ok(Work::Said(ServerText::Parameters {
                    parameters: Box::new(self.live.loop_parameters()),
                }))
            }
            ClientText::Snapshot { epoch } => {
                held(hand.as_ref())?;
                Ok(self.snapshot(epoch))
            }
            ClientText::Stop { operator, reason } => {
                check_role(self.pass, Role::Operator)?;
                let by = self.name(operator, hand.as_ref());
                let reason = reason.unwrap_or_else(|| NO_REASON.to_owned());
                self.tell("stop by stream");
                Ok(self.change(|live| async move { live.stop(&by, &reason).await.map(drop) }))
            }
            ClientText::ClearStop { operator } => {
                check_role(self.pass, Role::Operator)?;
                let by = self.name(operator, hand.as_ref());
                self.tell("clear stop by stream");
                Ok(self.change(|live| async move { live.clear_stop(by).await.map(drop) }))
            }
            ClientText::Request { tool, operator } => {
                check_role(self.pass, Role::Operator)?;
                Ok(self.control(tool, Control::Request { operator }, None))
            }
            ClientText::Withdraw { tool, operator } => {
                check_role(self.pass, Role::Operator)?;
                Ok(self.control(tool, Control::Withdraw { operator }, None))
            }
            ClientText::Grant { tool, operator } => {
                let lease = self.decides(tool, hand.as_ref())?;
                Ok(self.control(tool, Control::Grant { operator }, lease))
            }
            ClientText::Deny {
                tool,
                operator,
                reason,
            } => {
                let lease = self.decides(tool, hand.as_ref())?;
                let reason = reason.unwrap_or_else(|| NO_REASON.to_owned());
                Ok(self.control(tool, Control::Deny { operator, reason }, lease))
            }
            ClientText::Release { tool } => {
                let lease = self.decides(tool, hand.as_ref())?;
                Ok(self.control(tool, Control::Release, lease))
            }
            ClientText::Subscribe { .. }
            | ClientText::Patch { .. }
            | ClientText::Reset { .. }
            | ClientText::Ping { .. } => unreachable!("whoever watches may ask that, too"),
        }
    }

    fn join(
        &self,
        operator: String,
        device: String,
        token: Option<String>,
        hand: &mut Option<Hand>,
    ) -> Work {
        let (directory, id) = (self.api.directory().clone(), self.id.clone());
        let (live, pass) = (self.live.clone(), self.pass.clone());
        let doors = Arc::clone(&self.api.config().doors);
        let before = hand.take();
        begun(async move {
            if let Some(before) = before {
                // Its own tool is not to stand in its way.
                live.leave(before.lease()).await.ok();
            }
            let shown = token.map(|token| doors.admit(Some(&token)));
            let pass = match shown {
                None => pass,
                Some(Some(pass)) => pass,
                Some(None) => {
                    tokio::time::sleep(AFTER_A_WRONG_TOKEN).await;
                    return refused(NotGranted {
                        code: RefusalCode::TokenRejected,
                        reason: "the token is neither the server's nor that of an invite"
                            .to_owned(),
                        holder: None,
                    });
                }
            };
            let request = JoinRequest {
                protocol: PROTOCOL,
                operator: operator.clone(),
                device,
            };
            // Seen through to the end: where the socket goes meanwhile, the lease goes with the hand.
            let joined = see_through(async move {
                let grant = directory.join_on_socket(&id, &request, &pass).await?;
                let (keys, granted) = (grant.keys.to_bytes(), Box::new(grant.granted.clone()));
                Ok::<_, NotGranted>(Answer {
                    text: ServerText::Granted { keys, granted },
                    hand: Some(Hand::new(live, operator, grant, directory.clock())),
                    bricks: Vec::new(),
                })
            });
            match joined.await {
                Ok(Ok(answer)) => answer,
                Ok(Err(refusal)) => refused(refusal),
                Err(failure) => problem(failure).into(),
            }
        })
    }

    fn snapshot(&self, epoch: u32) -> Work {
        let live = self.live.clone();
        begun(async move {
            let read = tokio::task::spawn_blocking(move || {
                let (messages, (there, revision)) = bricks(&live, None);
                let clay = live.state().clay;
                let description = ClayDescription {
                    shape: clay.shape,
                    voxel_size_m: clay.voxel_size_m,
                    epoch: there,
                    revision,
                };
                (description, messages)
            });
            // It fails only where the server ends.
            let Ok((clay, messages)) = read.await else {
                return problem(OTHER_BLOCK.because("the server is ending")).into();
            };
            if clay.epoch != epoch {
                let words = format!("the clay is block {}, wanted {epoch}", clay.epoch);
                return problem(OTHER_BLOCK.because(words)).into();
            }
            Answer {
                text: ServerText::Snapshot {
                    clay,
                    messages: messages.len() as u32,
                },
                hand: None,
                bricks: messages,
            }
        })
    }

    /// The lease by which the holder of a tool decides about it; nothing for an admin.
    fn decides(&self, tool: u32, hand: Option<&Hand>) -> Result<Option<u32>, Failure> {
        match hand {
            Some(hand) if hand.tool() == tool => Ok(Some(hand.lease())),
            _ => check_decides(self.pass, self.live, tool),
        }
    }

    fn name(&self, given: Option<String>, hand: Option<&Hand>) -> String {
        match hand {
            Some(hand) => hand.operator().to_owned(),
            None => name_of(given, self.pass),
        }
    }

    fn tell(&self, did: &str) {
        let doors = &self.api.config().doors;
        doors.tell(&self.pass.who, did, Some(self.id), "asked");
    }

    fn control(&self, tool: u32, control: Control, lease: Option<u32>) -> Work {
        self.change(move |live| async move { live.control(tool, control, lease).await.map(drop) })
    }

    fn change<F>(&self, change: impl FnOnce(Live) -> F) -> Work
    where
        F: Future<Output = Result<(), ChangeError>> + Send + 'static,
    {
        let (id, change) = (self.id.clone(), see_through(change(self.live.clone())));
        begun(async move {
            match change.await {
                Ok(Ok(())) => ServerText::Done {}.into(),
                Ok(Err(error)) => problem(change_failure(error, &id)).into(),
                Err(failure) => problem(failure).into(),
            }
        })
    }
}

fn begun(change: impl Future<Output = Answer> + Send + 'static) -> Work {
    Work::Begun(Box::pin(change))
}

fn held(hand: Option<&Hand>) -> Result<&Hand, Failure> {
    hand.ok_or_else(|| NO_LEASE.because("this socket holds no tool"))
}

fn refused(refusal: NotGranted) -> Answer {
    ServerText::Refused {
        code: refusal.code,
        reason: refusal.reason,
        holder: refusal.holder,
    }
    .into()
}
