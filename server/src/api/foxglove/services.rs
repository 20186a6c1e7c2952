//! What can be asked of a session: the same calls as over HTTP, by whoever may make those.

use axum::http::Method;
use teleclay_foxglove::connection::SERVICE_ENCODING;
use teleclay_foxglove::server::{Service, ServiceMessage};
use teleclay_proto::http::{ClayReset, SessionPatch};
use teleclay_proto::{Scheme, SessionId};
use teleclay_ros::own::{SetSchemeRequest, SetSchemeResponse};
use teleclay_ros::standard::{SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse};
use teleclay_ros::{Message, definition, from_cdr, names, to_cdr};

use crate::api::guard::check_call;
use crate::api::problem::Failure;
use crate::api::sessions::change_failure;
use crate::directory::{ChangeError, Live};
use crate::doors::Pass;

/// A service of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Errand {
    Pause,
    ResetClay,
    SetScheme,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    Patch(Box<SessionPatch>),
    Reset,
}

impl Errand {
    pub(super) const ALL: [Self; 3] = [Self::Pause, Self::ResetClay, Self::SetScheme];

    const fn word(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::ResetClay => "reset_clay",
            Self::SetScheme => "set_scheme",
        }
    }

    const fn kind(self) -> &'static str {
        match self {
            Self::Pause => "std_srvs/srv/SetBool",
            Self::ResetClay => "std_srvs/srv/Trigger",
            Self::SetScheme => "teleclay_msgs/srv/SetScheme",
        }
    }

    /// The service as it is described.
    pub(super) fn describe(self, id: u32, session: &str) -> Service {
        let [request, response] = match self {
            Self::Pause => [SetBoolRequest::NAME, SetBoolResponse::NAME],
            Self::ResetClay => [TriggerRequest::NAME, TriggerResponse::NAME],
            Self::SetScheme => [SetSchemeRequest::NAME, SetSchemeResponse::NAME],
        }
        .map(|name| ServiceMessage {
            encoding: SERVICE_ENCODING.to_owned(),
            schema_name: name.to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: definition(name).unwrap_or_default(),
        });
        Service {
            id,
            name: names::service(session, self.word()),
            kind: self.kind().to_owned(),
            request,
            response,
        }
    }

    /// Whether whoever has this pass may have it done: whoever may make the same call over HTTP.
    pub(super) fn check(self, pass: &Pass, id: &SessionId) -> Result<(), Failure> {
        let path = format!("/api/v1/sessions/{id}");
        match self {
            Self::Pause | Self::SetScheme => check_call(pass, &Method::PATCH, &path),
            Self::ResetClay => check_call(pass, &Method::POST, &format!("{path}/clay/reset")),
        }
    }

    /// What a request asks for.
    ///
    /// # Errors
    /// It is no such request, in words.
    pub(super) fn read(self, request: &[u8]) -> Result<Change, String> {
        let unread = |error| format!("the request is no {}_Request: {error}", self.kind());
        let patch = |patch| Ok(Change::Patch(Box::new(patch)));
        match self {
            Self::Pause => {
                let SetBoolRequest { data } = from_cdr(request).map_err(unread)?;
                patch(SessionPatch {
                    paused: Some(data),
                    ..SessionPatch::default()
                })
            }
            Self::ResetClay => {
                let TriggerRequest = from_cdr(request).map_err(unread)?;
                Ok(Change::Reset)
            }
            Self::SetScheme => {
                let SetSchemeRequest { scheme } = from_cdr(request).map_err(unread)?;
                let scheme: Scheme = scheme.parse().map_err(|error| format!("{error}"))?;
                patch(SessionPatch {
                    scheme: Some(scheme),
                    ..SessionPatch::default()
                })
            }
        }
    }

    /// The response.
    pub(super) fn write(self, done: Result<&str, &str>) -> Vec<u8> {
        let success = done.is_ok();
        let message = done.unwrap_or_else(|reason| reason);
        let mut out = Vec::new();
        match self {
            Self::Pause => to_cdr(&SetBoolResponse { success, message }, &mut out),
            Self::ResetClay => to_cdr(&TriggerResponse { success, message }, &mut out),
            Self::SetScheme => to_cdr(&SetSchemeResponse { success, message }, &mut out),
        }
        out
    }
}

impl Change {
    /// Has it done, as a call over HTTP does.
    pub(super) async fn carry_out(self, live: Live) -> Result<String, Failure> {
        let done = match self {
            Self::Patch(patch) => match patch.fits(live.state().network) {
                Ok(()) => live.patch(*patch).await,
                Err(error) => Err(ChangeError::Field(error)),
            },
            Self::Reset => live.reset(ClayReset::default(), None).await,
        };
        match done {
            Ok(session) => Ok(format!("revision {}", session.revision)),
            Err(error) => Err(change_failure(error, live.id())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cdr(message: &impl Message) -> Vec<u8> {
        let mut out = Vec::new();
        to_cdr(message, &mut out);
        out
    }

    #[test]
    fn each_request_is_the_change_that_it_says() {
        let read = Errand::Pause.read(&cdr(&SetBoolRequest { data: true }));
        let Ok(Change::Patch(patch)) = read else {
            panic!("{read:?}")
        };
        assert_eq!((patch.paused, patch.scheme), (Some(true), None));
        let read = Errand::SetScheme.read(&cdr(&SetSchemeRequest { scheme: "wave" }));
        let Ok(Change::Patch(patch)) = read else {
            panic!("{read:?}")
        };
        assert_eq!((patch.paused, patch.scheme), (None, Some(Scheme::Wave)));
        assert_eq!(
            Errand::ResetClay.read(&cdr(&TriggerRequest)),
            Ok(Change::Reset)
        );
    }

    #[test]
    fn what_is_no_request_is_told_with_what_it_should_be() {
        let said = Errand::Pause.read(&[]).unwrap_err();
        assert!(said.contains("SetBool_Request"), "{said}");
        let said = Errand::SetScheme
            .read(&cdr(&SetSchemeRequest { scheme: "waves" }))
            .unwrap_err();
        assert!(
            said.contains("`waves`") && said.contains("replica"),
            "{said}"
        );
    }

    #[test]
    fn every_service_is_described_with_its_schemas() {
        for errand in Errand::ALL {
            let service = errand.describe(1, "demo");
            assert!(service.name.starts_with("/teleclay/demo/"));
            for side in [&service.request, &service.response] {
                assert!(side.schema_name.starts_with(&service.kind), "{service:?}");
            }
            assert!(
                service.response.schema.contains("bool success"),
                "{service:?}"
            );
        }
    }
}
