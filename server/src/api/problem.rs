//! How a call fails: RFC 9457 problem details, one catalogue for every call.
//!
//! Each kind of problem has a stable type `/problems/<word>` that programs may match on, a title and a status that
//! never change, and a page at that address that explains it. The detail is what happened this time.

use std::fmt;

use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use teleclay_proto::http::{BodyError, FieldError, Problem};

/// A kind of problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kind {
    /// Last part of its type.
    pub(crate) word: &'static str,
    pub(crate) title: &'static str,
    pub(crate) status: StatusCode,
    /// What it means and what to do, in a sentence or two.
    pub(crate) meaning: &'static str,
}

macro_rules! kinds {
    ($($name:ident = $status:ident $word:literal, $title:literal, $meaning:literal;)+) => {
        $(
            #[doc = $meaning]
            pub(crate) const $name: Kind = Kind {
                word: $word,
                title: $title,
                status: StatusCode::$status,
                meaning: $meaning,
            };
        )+
        /// Every kind of problem, in the order of its status.
        pub(crate) const KINDS: &[Kind] = &[$($name),+];
    };
}

kinds! {
    SYNTAX = BAD_REQUEST "syntax", "the body is not JSON",
        "The detail names line and column.";
    PATH = BAD_REQUEST "path", "the path cannot be read",
        "A part of the path is not UTF-8 once its percent signs are decoded.";
    HOST_MISSING = BAD_REQUEST "host-missing", "the request does not say which host it is for",
        "A request needs exactly one Host, of the form name or name:port.";
    SUBPROTOCOL = BAD_REQUEST "subprotocol", "the subprotocol is not offered",
        "A stream speaks teleclay.v1: name it in Sec-WebSocket-Protocol. A token may follow as bearer.<token>.";
    HANDSHAKE = BAD_REQUEST "handshake", "the WebSocket handshake is not complete",
        "A header that RFC 6455 asks for is missing or has another value.";
    TOKEN = UNAUTHORIZED "token", "a token is needed",
        "This server has a token configured. Send it, or that of an invite, as Authorization: Bearer <token>; a WebSocket from a browser, which cannot set headers, as the second subprotocol bearer.<token>.";
    ORIGIN = FORBIDDEN "origin", "pages of this origin may not do that",
        "A page from elsewhere asked on behalf of somebody's browser. Origins other than the server's own must be configured.";
    NOT_ALLOWED = FORBIDDEN "not-allowed", "the invite is not good for that",
        "A spectator reads, an operator holds tools too, an admin changes the session too, each in the session of the invite; what concerns the server is for whoever has its own token.";
    NO_SUCH_PATH = NOT_FOUND "no-such-path", "nothing is here",
        "The interface is described at /api/docs.";
    NO_SUCH_SESSION = NOT_FOUND "no-such-session", "there is no such session",
        "GET /api/v1/sessions lists the sessions there are.";
    NO_SUCH_RECORDING = NOT_FOUND "no-such-recording", "there is no such recording",
        "GET /api/v1/sessions/{id}/recordings lists those of a session; a file's name is a recording's, and .mcap.";
    NO_SUCH_TOOL = NOT_FOUND "no-such-tool", "there is no such tool",
        "A session's tools are numbered from 1; its state lists them.";
    METHOD = METHOD_NOT_ALLOWED "method", "the method is not offered here",
        "The header Allow lists those that are.";
    SLOW_BODY = REQUEST_TIMEOUT "slow-body", "the body did not come in time",
        "The whole body must arrive within a few seconds.";
    SESSION_EXISTS = CONFLICT "session-exists", "a session of this name exists",
        "Choose another id, or delete the one that exists.";
    TOO_MANY_SESSIONS = CONFLICT "too-many-sessions", "there are as many sessions as there may be",
        "Delete one first.";
    SESSION_DAMAGED = CONFLICT "session-damaged", "the session's files are damaged",
        "It was set aside when the server started, its files as they are; the detail says what is wrong with them. DELETE removes it for good.";
    RECORDING = CONFLICT "recording", "the recording is otherwise",
        "A session has one recording at a time, each has a name of its own, and all of them have a bound on disk. The detail says which it is.";
    NOTHING_THERE = CONFLICT "nothing-there", "there is no such stroke",
        "No stroke of the present block can be undone or redone as asked.";
    NOT_KEPT = CONFLICT "not-kept", "that is no longer kept",
        "A session's history is kept up to a bound on disk, and not at all by a server that was started with --ephemeral.";
    NOT_STOPPED = CONFLICT "not-stopped", "the session is not stopped",
        "There is no stop to be cleared.";
    CONTROL = CONFLICT "control", "the tool is held otherwise",
        "What was asked for does not fit who holds the tool and who has asked for it; the detail says how.";
    NO_LEASE = CONFLICT "no-lease", "this socket holds no tool",
        "Frames, parameters and snapshots are for the hand that has joined on the same socket.";
    OTHER_BLOCK = CONFLICT "other-block", "the clay is another block by now",
        "The block that was asked for is gone; the state tells which one there is.";
    CLAY_MEMORY = CONFLICT "clay-memory", "there is no memory for so much clay",
        "The clay of all sessions has a bound, --clay-memory; the detail says what is free. Take larger voxels, or delete a session.";
    TOO_LARGE = PAYLOAD_TOO_LARGE "too-large", "the body is too large",
        "No body of this interface needs 64 KiB, and no message to a stream 16 KiB; one that is longer ends the stream with code 1009.";
    MEDIA_TYPE = UNSUPPORTED_MEDIA_TYPE "media-type", "the body is of another media type",
        "Bodies are JSON: send Content-Type: application/json and no Content-Encoding.";
    HOST = MISDIRECTED_REQUEST "host", "this server does not go by that name",
        "Without a token the server answers only to localhost and loopback addresses, so that no name of somebody else's can be pointed at it.";
    RANGE = RANGE_NOT_SATISFIABLE "range", "the file has no such bytes",
        "A Range names bytes from 0 on; the header Content-Range of the answer says how many the file has.";
    FIELD = UNPROCESSABLE_ENTITY "field", "a field is not acceptable",
        "The pointer names the field; it is unknown, missing, of another type or out of its range.";
    UNREACHABLE = UNPROCESSABLE_ENTITY "unreachable", "the robot does not reach so far",
        "For some arm V of (12) is below zero; the detail says which.";
    NO_ASSEMBLY = UNPROCESSABLE_ENTITY "no-assembly", "the rods do not meet",
        "The three spheres around the elbows have no point in common at these joint angles.";
    SINGULAR = UNPROCESSABLE_ENTITY "singular", "the robot is singular there",
        "An arm is stretched or folded, or the platform gains a freedom; the detail says which.";
    MESH = UNPROCESSABLE_ENTITY "mesh", "the file is no mesh",
        "The detail says what is wrong with it, and where.";
    MESH_OPEN = UNPROCESSABLE_ENTITY "mesh_open", "the mesh is open",
        "Every edge must belong to two triangles that run along it in opposite directions; the detail says how many do not.";
    MESH_EMPTY = UNPROCESSABLE_ENTITY "mesh_empty", "the mesh encloses nothing",
        "There is no triangle in it, or no volume.";
    MESH_TOO_LARGE = UNPROCESSABLE_ENTITY "mesh_too_large", "the mesh is larger than the block",
        "The detail gives both sizes. With fit=true it is scaled into the block.";
    VOLUME = UNPROCESSABLE_ENTITY "volume", "the file is no volume that is read",
        "The detail says what is wrong with it, or what of it is not read.";
    VOLUME_EMPTY = UNPROCESSABLE_ENTITY "volume_empty", "the volume has no clay",
        "Nothing in it is at or above the first threshold.";
    VOLUME_TOO_LARGE = UNPROCESSABLE_ENTITY "volume_too_large", "the volume is larger than the block",
        "The detail gives both sizes. With fit=true it is scaled into the block.";
    NO_LOOP = UNPROCESSABLE_ENTITY "no-loop", "these parts make no loop",
        "A compensator or the loop itself cannot be formed of them; the detail says why.";
    UNTUNABLE = UNPROCESSABLE_ENTITY "untunable", "no handle meets the target",
        "The detail says what stands against it, and what would have to give.";
    INFEASIBLE = UNPROCESSABLE_ENTITY "infeasible", "the experiment comes to no end that means something",
        "The detail says which range is at fault and why.";
    UPGRADE = UPGRADE_REQUIRED "upgrade", "this is a WebSocket",
        "Ask with Connection: upgrade and Upgrade: websocket.";
    TOO_MANY_TRIES = TOO_MANY_REQUESTS "too-many-tries", "too many wrong tokens came from there",
        "An address may show 20 wrong tokens at once, and then one a second; until then no token of its is looked at. Retry-After says when.";
    INTERNAL = INTERNAL_SERVER_ERROR "internal", "the server made a mistake",
        "This is a defect of the server's. Its log says more.";
    NOT_READY = SERVICE_UNAVAILABLE "not-ready", "the server is not ready",
        "The loop does not run or Zenoh is not up; the detail says which.";
    UNAVAILABLE = SERVICE_UNAVAILABLE "unavailable", "the server cannot do that now",
        "The detail says why. Try again later.";
    NO_TICK_TIME = SERVICE_UNAVAILABLE "no_tick_time", "there is no time for another session",
        "Its ticks would make those of others late; the detail says what it would take of a tick and what is free. Somebody has to let go of a tool first, or the server needs more threads: --tick-threads, --tick-budget.";
    NO_ANSWER = SERVICE_UNAVAILABLE "no-answer", "the answer did not come in time",
        "The server is overloaded, or the loop has stopped. Whether the change was made is not known.";
    TOO_MANY_WATCHERS = SERVICE_UNAVAILABLE "too-many-watchers", "there are as many watchers as there may be",
        "Close a stream first. An address other than the server's own may have 16 at once.";
    BUSY = SERVICE_UNAVAILABLE "busy", "too many large answers or calculations are under way",
        "Try again when another has ended.";
}

/// Longest part of a path that a detail repeats, bytes.
const MOST_OF_PATH: usize = 200;

/// The path that was asked for, as a detail names it. Of a request that a nested router answers, `asked` is the
/// original.
pub(crate) fn path_of(asked: &Uri) -> String {
    let path = asked.path();
    match path.get(..MOST_OF_PATH) {
        Some(start) if start.len() < path.len() => format!("{start}…"),
        _ => path.to_owned(),
    }
}

impl Kind {
    /// A failure of this kind.
    pub(crate) fn because(self, detail: impl Into<String>) -> Failure {
        Failure::from(Problem::new(
            self.word,
            self.title,
            self.status.as_u16(),
            detail,
        ))
    }
}

/// Why a call is not answered as it asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) struct Failure {
    problem: Box<Problem>,
    headers: Option<Box<HeaderMap>>,
}

impl Failure {
    /// The same failure, with a header that its status asks for.
    pub(crate) fn with_header(mut self, name: HeaderName, value: HeaderValue) -> Self {
        self.headers.get_or_insert_default().insert(name, value);
        self
    }

    /// Whether it is of this kind.
    pub(crate) fn is(&self, kind: Kind) -> bool {
        self.problem.title == kind.title
    }

    /// What is told of it.
    pub(crate) fn into_problem(self) -> Problem {
        *self.problem
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.problem.title, self.problem.detail)
    }
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        Self {
            problem: Box::new(problem),
            headers: None,
        }
    }
}

impl From<BodyError> for Failure {
    fn from(error: BodyError) -> Self {
        Problem::from(error).into()
    }
}

impl From<FieldError> for Failure {
    fn from(error: FieldError) -> Self {
        Problem::from(error).into()
    }
}

impl IntoResponse for Failure {
    fn into_response(self) -> Response {
        // Every kind has a status of the library's own; a number that is none could only be a defect here.
        let status =
            StatusCode::from_u16(self.problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let body = serde_json::to_vec(&self.problem).unwrap_or_default();
        let mut response = (status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(
            header::CONTENT_TYPE,
            HeaderValue::from_static(Problem::MEDIA_TYPE),
        );
        if status == StatusCode::SERVICE_UNAVAILABLE {
            headers.insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
        }
        if let Some(more) = self.headers {
            headers.extend(*more);
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn words_are_unique_and_fit_into_an_address() {
        let words: BTreeSet<_> = KINDS.iter().map(|kind| kind.word).collect();
        assert_eq!(words.len(), KINDS.len());
        for word in words {
            assert!(
                word.bytes()
                    .all(|byte| byte.is_ascii_lowercase() || matches!(byte, b'-' | b'_')),
                "{word}"
            );
        }
    }

    /// The protocol's own conversions must land in the same catalogue.
    #[test]
    fn errors_of_bodies_are_in_the_catalogue() {
        let field = Problem::from(FieldError::new("/a", "b"));
        let syntax = Problem::from(BodyError::Syntax {
            line: 1,
            column: 2,
            detail: "c".to_owned(),
        });
        for (problem, kind) in [(field, FIELD), (syntax, SYNTAX)] {
            assert_eq!(problem.kind, format!("/problems/{}", kind.word));
            assert_eq!(problem.title, kind.title);
            assert_eq!(problem.status, kind.status.as_u16());
        }
    }

    #[test]
    fn a_busy_server_says_when_to_ask_again() {
        let response = BUSY.because("four are under way").into_response();
        assert_eq!(response.status(), 503);
        assert_eq!(response.headers()[header::RETRY_AFTER], "1");
        assert_eq!(
            response.headers()[header::CONTENT_TYPE],
            "application/problem+json"
        );
    }
}
