//! What somebody asks on a socket who holds a tool, or wants one.

use std::time::{Duration, Instant};

use teleclay_front::{Peer, ShownFor};
use teleclay_proto::http::NO_REASON;
use teleclay_proto::invite::Role;
use teleclay_proto::join::{ClayDescription, JoinRequest, RefusalCode};
use teleclay_proto::watch::{ClientText, ServerText};
use teleclay_proto::{PROTOCOL, SessionId};

use super::answer::{Answer, Change, problem, told_of_change};
use super::hand::Hand;

use crate::api::guard::{check_role, look_at};
use crate::api::manners::{check_decides, name_of};
use crate::api::problem::{Failure, NO_LEASE, OTHER_BLOCK};
use crate::api::{Api, see_through};
use crate::directory::{ChangeError, Control, Live, NotGranted};
use crate::doors::Pass;
use crate::network::whole;

/// From one snapshot to the next of the same socket: more than 2 Mbit/s is for nobody to ask for.
const SNAPSHOTS_EVERY: Duration = Duration::from_secs(2);

/// Who asks.
#[derive(Clone, Copy)]
pub(super) struct Asker<'a> {
    pub(super) api: &'a Api,
    pub(super) id: &'a SessionId,
    pub(super) live: &'a Live,
    pub(super) pass: &'a Pass,
    pub(super) peer: Option<Peer>,
}

/// What there is to do.
pub(super) enum Work {
    /// Nothing but to say this.
    Said(ServerText),
    /// To wait for this.
    Begun(Change),
}

impl<'a> Asker<'a> {
    /// Who asks, by the better of two passes: whoever has joined with another token may do what that one is for.
    pub(super) fn with(self, other: Option<&'a Pass>) -> Self {
        let better = other.filter(|other| self.pass.role < other.role);
        Self {
            pass: better.unwrap_or(self.pass),
            ..self
        }
    }

    /// Begins what was asked, of a socket that has this hand and was sent a snapshot last at that time.
    ///
    /// # Errors
    /// It cannot be asked here.
    pub(super) fn work(
        &self,
        asked: ClientText,
        hand: &mut Option<Hand>,
        snapshot_at: &mut Option<Instant>,
    ) -> Result<Work, Failure> {
        let pass = hand.as_ref().map(|hand| hand.pass().clone());
        let by = self.with(pass.as_ref());
        match asked {
            ClientText::Join {
                operator,
                device,
                token,
            } => self.join(operator, device.name, token, hand),
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
                Ok(self.snapshot(epoch, snapshot_at))
            }
            ClientText::ClearStop { operator } => {
                by.check(Role::Operator, "clear stop by stream")?;
                let name = match &*hand {
                    Some(hand) => hand.operator().to_owned(),
                    None => by.name(operator),
                };
                by.tell("clear stop by stream");
                Ok(self.change(|live| async move { live.clear_stop(name).await.map(drop) }))
            }
            ClientText::Request { tool, operator } => {
                by.check(Role::Operator, "request by stream")?;
                Ok(by.control(tool, Control::Request { operator }, None))
            }
            ClientText::Withdraw { tool, operator } => {
                by.check(Role::Operator, "withdraw by stream")?;
                Ok(by.control(tool, Control::Withdraw { operator }, None))
            }
            ClientText::Grant { tool, operator } => {
                let lease = by.decides(tool, hand.as_ref())?;
                Ok(by.control(tool, Control::Grant { operator }, lease))
            }
            ClientText::Deny {
                tool,
                operator,
                reason,
            } => {
                let lease = by.decides(tool, hand.as_ref())?;
                let reason = reason.unwrap_or_else(|| NO_REASON.to_owned());
                Ok(by.control(tool, Control::Deny { operator, reason }, lease))
            }
            ClientText::Release { tool } => {
                let lease = by.decides(tool, hand.as_ref())?;
                Ok(by.control(tool, Control::Release, lease))
            }
            ClientText::Subscribe { .. }
            | ClientText::Patch { .. }
            | ClientText::Reset { .. }
            | ClientText::Ping { .. }
            | ClientText::Stop { .. } => unreachable!("it is done elsewhere"),
        }
    }

    fn join(
        &self,
        operator: String,
        device: String,
        token: Option<String>,
        hand: &mut Option<Hand>,
    ) -> Result<Work, Failure> {
        let pass = match token {
            None => self.pass.clone(),
            Some(token) => match self.admit(&token)? {
                Some(pass) => pass,
                None => {
                    let doors = &self.api.config().doors;
                    doors.tell_refused(&self.pass.who, "join", Some(self.id), "rejected");
                    return Ok(Work::Said(refused(NotGranted {
                        code: RefusalCode::TokenRejected,
                        reason: "the token is neither the server's nor that of an invite"
                            .to_owned(),
                        holder: None,
                    })));
                }
            },
        };
        let (directory, id, live) = (
            self.api.directory().clone(),
            self.id.clone(),
            self.live.clone(),
        );
        let before = hand.take();
        Ok(begun(async move {
            if let Some(before) = before {
                // Its own tool is not to stand in its way.
                live.leave(before.lease()).await.ok();
            }
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
                    hand: Some(Hand::new(live, operator, pass, grant, directory.clock())),
                    bricks: Vec::new(),
                })
            });
            match joined.await {
                Ok(Ok(answer)) => answer,
                Ok(Err(refusal)) => refused(refusal).into(),
                Err(failure) => problem(failure).into(),
            }
        }))
    }

    /// What somebody may do who shows this token, nothing included; where too many wrong ones came, none is looked at.
    fn admit(&self, token: &str) -> Result<Option<Pass>, Failure> {
        let doors = &self.api.config().doors;
        if !doors.needs_token() {
            return Ok(doors.admit(None));
        }
        look_at(doors, self.api.tries(), self.peer, token, ShownFor::Else)
    }

    /// Whether the role does for it; writes down where not.
    ///
    /// # Errors
    /// It does not.
    pub(super) fn check(&self, role: Role, did: &str) -> Result<(), Failure> {
        let checked = check_role(self.pass, role);
        if checked.is_err() {
            let doors = &self.api.config().doors;
            doors.tell_refused(&self.pass.who, did, Some(self.id), "403");
        }
        checked
    }

    fn snapshot(&self, epoch: u32, last: &mut Option<Instant>) -> Work {
        let live = self.live.clone();
        let now = Instant::now();
        let at = last.map_or(now, |last| now.max(last + SNAPSHOTS_EVERY));
        *last = Some(at);
        begun(async move {
            tokio::time::sleep_until(at.into()).await;
            let read = tokio::task::spawn_blocking(move || {
                let (messages, (there, revision)) = whole(&live);
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
        let decides = match hand {
            Some(hand) if hand.tool() == tool => Ok(Some(hand.lease())),
            _ => check_decides(self.pass, self.live, tool),
        };
        if decides.is_err() {
            let doors = &self.api.config().doors;
            doors.tell_refused(&self.pass.who, "decide by stream", Some(self.id), "403");
        }
        decides
    }

    pub(super) fn name(&self, given: Option<String>) -> String {
        name_of(given, self.pass)
    }

    pub(super) fn tell(&self, did: &str) {
        let doors = &self.api.config().doors;
        doors.tell(&self.pass.who, did, Some(self.id), "asked");
    }

    fn control(&self, tool: u32, control: Control, lease: Option<u32>) -> Work {
        self.tell(&format!("{} tool {tool} by stream", control.word()));
        self.change(move |live| async move { live.control(tool, control, lease).await.map(drop) })
    }

    fn change<F>(&self, change: impl FnOnce(Live) -> F) -> Work
    where
        F: Future<Output = Result<(), ChangeError>> + Send + 'static,
    {
        let (id, change) = (self.id.clone(), see_through(change(self.live.clone())));
        begun(async move { told_of_change(change.await, &id).into() })
    }
}

fn begun(change: impl Future<Output = Answer> + Send + 'static) -> Work {
    Work::Begun(Box::pin(change))
}

fn held(hand: Option<&Hand>) -> Result<&Hand, Failure> {
    hand.ok_or_else(|| NO_LEASE.because("this socket holds no tool"))
}

fn refused(refusal: NotGranted) -> ServerText {
    ServerText::Refused {
        code: refusal.code,
        reason: refusal.reason,
        holder: refusal.holder,
    }
}
