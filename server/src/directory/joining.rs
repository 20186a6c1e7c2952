//! Who gets a tool, and who loses it with an invite.

use std::sync::Arc;

use teleclay_channel::{Keys, fresh_keys};
use teleclay_proto::http::parse;
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, Granted, JoinReply, JoinRequest, RefusalCode, SealedJoin,
    SealedReply,
};
use teleclay_proto::watch::Level;
use teleclay_proto::{PROTOCOL, SessionId};

use super::not_granted::NotGranted;
use super::{Directory, Live};
use crate::doors::{Heard, LeaseChannel, Pass, SocketLine, TO_HOLD_A_TOOL, Way};
use crate::engine::FramesIn;
use crate::session::slot_of;

/// A lease on a socket.
pub(crate) struct SocketGrant {
    pub(crate) granted: Granted,
    pub(crate) keys: Keys,
    /// What comes for the handle.
    pub(crate) line: Arc<SocketLine>,
    /// Where its frames go.
    pub(crate) frames: FramesIn,
}

fn no_such_session(id: &SessionId) -> NotGranted {
    NotGranted::because(
        RefusalCode::NoSuchSession,
        format!("there is no session `{id}` on this server"),
    )
}

/// Opens the line of a lease. One that has ended meanwhile is told so: whoever took it away found no line to say it on.
fn open_line(live: &Live, slot: usize, holder: LeaseChannel) {
    let holder = Arc::new(holder);
    live.shared.channels.open(slot, Arc::clone(&holder));
    let reason = {
        let snapshot = live.shared.snapshot();
        if snapshot.slot_of(holder.lease).is_some() {
            return;
        }
        snapshot.stop.as_ref().map_or_else(
            || "the lease ended as soon as it was granted".to_owned(),
            |stop| format!("{} has stopped the session: {}", stop.by, stop.reason),
        )
    };
    live.shared.say_farewell(slot, holder, reason);
}

impl Directory {
    /// A challenge for a join to session `id`, or why none can be granted.
    pub(crate) fn challenge(&self, id: &SessionId, request: ChallengeRequest) -> ChallengeReply {
        match self.find_session(id, request.protocol) {
            Ok(_) => ChallengeReply::Given {
                challenge: self.0.doors.challenge(),
                needs_token: self.0.doors.needs_token(),
            },
            Err(NotGranted { code, reason, .. }) => ChallengeReply::Refused { code, reason },
        }
    }

    /// Gives a tool to an operator, if the join that was asked on `key` shows the secret. Says nothing to one that
    /// answers another server's challenge.
    pub(crate) async fn join(
        &self,
        id: &SessionId,
        key: &str,
        join: &SealedJoin,
    ) -> Option<SealedReply> {
        let Heard {
            payload,
            answering,
            pass,
        } = match self.0.doors.hear(key, id, join) {
            Ok(heard) => heard,
            Err(unheard) => {
                return unheard.map(|(code, reason)| SealedReply::Refused { code, reason });
            }
        };
        let answer = |reply: &JoinReply| {
            answering.answer(&serde_json::to_vec(reply).expect("plain data has a JSON form"))
        };
        let admitted = match parse(&payload) {
            Ok(request) => self.admit(id, &request, &pass).await,
            Err(error) => Err(NotGranted::because(
                RefusalCode::BadRequest,
                error.to_string(),
            )),
        };
        self.tell_join(id, &pass, &admitted);
        let message = match admitted {
            Ok((live, granted)) => {
                let (slot, lease) = (slot_of(granted.tool), granted.lease);
                let (message, keys) = answer(&JoinReply::Granted(Box::new(granted)));
                // Before the answer is on its way: the first frame may follow at once.
                let holder = LeaseChannel::new(lease, &keys, pass, Way::Zenoh);
                open_line(&live, slot, holder);
                message
            }
            Err(NotGranted {
                code,
                reason,
                holder,
            }) => {
                answer(&JoinReply::Refused {
                    code,
                    reason,
                    holder,
                })
                .0
            }
        };
        Some(SealedReply::Answered { message })
    }

    /// Gives a tool to whoever asks for one on a socket, where nobody else can read the keys.
    ///
    /// # Errors
    /// Why not.
    pub(crate) async fn join_on_socket(
        &self,
        id: &SessionId,
        request: &JoinRequest,
        pass: &Pass,
    ) -> Result<SocketGrant, NotGranted> {
        let admitted = self.admit(id, request, pass).await;
        self.tell_join(id, pass, &admitted);
        let (live, granted) = admitted?;
        let frames = self.frames(id).ok_or_else(|| no_such_session(id))?;
        let (keys, line) = (fresh_keys(), Arc::new(SocketLine::default()));
        let way = Way::Socket(Arc::clone(&line));
        let holder = LeaseChannel::new(granted.lease, &keys, pass.clone(), way);
        let slot = slot_of(granted.tool);
        open_line(&live, slot, holder);
        Ok(SocketGrant {
            granted,
            keys,
            line,
            frames,
        })
    }

    fn tell_join(
        &self,
        id: &SessionId,
        pass: &Pass,
        admitted: &Result<(Live, Granted), NotGranted>,
    ) {
        let doors = &self.0.doors;
        match admitted {
            Ok((_, granted)) => {
                let outcome = format!("lease {} of tool {}", granted.lease, granted.tool);
                doors.tell(&pass.who, "join", Some(id), &outcome);
            }
            Err(refusal) => doors.tell_refused(&pass.who, "join", Some(id), refusal.code.word()),
        }
    }

    async fn admit(
        &self,
        id: &SessionId,
        request: &JoinRequest,
        pass: &Pass,
    ) -> Result<(Live, Granted), NotGranted> {
        if !pass.covers(id) || pass.role < TO_HOLD_A_TOOL {
            return Err(NotGranted::because(
                RefusalCode::NotAllowed,
                format!("the invite does not let anybody hold a tool of session `{id}`"),
            ));
        }
        let live = self.find_session(id, request.protocol)?;
        let granted = live.grant(request, &self.0).await?;
        Ok((live, granted))
    }

    /// Takes the tools of those whose invite has ended, and tells them.
    pub(crate) async fn let_go_of_guests(&self) {
        for live in self.lives() {
            for (slot, holder) in live.channels().holders() {
                let holds = live.shared.snapshot().slot_of(holder.lease).is_some();
                if !holds || self.0.doors.is_good(&holder.pass) {
                    continue;
                }
                // It may have left meanwhile.
                if live.leave(holder.lease).await.is_err() {
                    continue;
                }
                let who = &holder.pass.who;
                self.0
                    .doors
                    .tell(who, "leave", Some(live.id()), "the invite has ended");
                let words = format!("lease {} was taken back: {who} has ended", holder.lease);
                live.shared.emit(Level::Warning, words);
                live.shared
                    .say_farewell(slot, holder, "the invite has ended".to_owned());
            }
        }
    }

    fn find_session(&self, id: &SessionId, protocol: u32) -> Result<Live, NotGranted> {
        if protocol != PROTOCOL {
            let reason = format!("this server speaks protocol {PROTOCOL}, the request {protocol}");
            return Err(NotGranted::because(RefusalCode::ProtocolMismatch, reason));
        }
        self.session(id).ok_or_else(|| no_such_session(id))
    }
}
