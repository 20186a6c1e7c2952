//! Who may ask what: host, origin, token and what it is good for, checked before anything else happens.
//!
//! | check | against | applies |
//! |---|---|---|
//! | Host | a name of somebody else's that resolves to this machine, so that their page is "same origin" here | all requests while no token is configured |
//! | Origin | a page from elsewhere that asks on behalf of its visitor; WebSockets are not covered by CORS | requests that change something, and WebSockets |
//! | token | everyone else; after many wrong ones, everybody at that address for a while | `/api/v1` and `/metrics` while one is configured |
//! | what it is good for | guests who go further than they were invited to | the same |

use std::net::IpAddr;
use std::time::Instant;

use axum::extract::OriginalUri;
use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use teleclay_doors::audit::Deed;
use teleclay_front::{Peer, ShownFor, Tries};
use teleclay_proto::invite::Role;
use tower_http::cors::CorsLayer;

use super::problem::{
    Failure, HOST, HOST_MISSING, NOT_ALLOWED, ORIGIN, TOKEN, TOO_MANY_TRIES, path_of,
};
use super::{Api, ApiConfig};
use crate::doors::{Doors, Pass, Who};

/// What stands before a token among the subprotocols of a WebSocket.
pub(crate) const BEARER_SUBPROTOCOL: &str = "bearer.";

/// Lets a request through whose host and origin are acceptable.
pub(crate) async fn require_host_and_origin(
    State(api): State<Api>,
    request: Request,
    next: Next,
) -> Response {
    match check_host_and_origin(api.config(), &request) {
        Ok(()) => next.run(request).await,
        Err(failure) => failure.into_response(),
    }
}

/// Lets a request through that shows a token which is good for it, or any while none is configured. Calls find the
/// [`Pass`] among the request's extensions.
pub(crate) async fn require_token(
    State(api): State<Api>,
    OriginalUri(asked): OriginalUri,
    mut request: Request,
    next: Next,
) -> Response {
    let peer = request.extensions().get::<Peer>().copied();
    let doors = &api.config().doors;
    let need = Need::of(request.method(), asked.path());
    let changes = need.role != Role::Spectator;
    let mut deed = Deed {
        who: Who::Anybody.to_string(),
        from: peer.map(|Peer(address)| address),
        did: format!("{} {}", request.method(), path_of(&asked)),
        session: need.session().map(str::to_owned),
        outcome: String::new(),
    };
    let what = if is_stop(request.method(), asked.path()) {
        ShownFor::Stop
    } else {
        ShownFor::Else
    };
    let answer = match check_token(doors, api.tries(), peer, request.headers(), what) {
        Ok(pass) => {
            deed.who = pass.who.to_string();
            match need.check(&pass) {
                Ok(()) => {
                    request.extensions_mut().insert(pass);
                    next.run(request).await
                }
                Err(failure) => failure.into_response(),
            }
        }
        Err(failure) => failure.into_response(),
    };
    let status = answer.status().as_u16();
    deed.outcome = status.to_string();
    if matches!(status, 401 | 403 | 429) {
        doors.tell_refused_deed(deed);
    } else if changes {
        doors.tell_deed(deed);
    }
    answer
}

/// What a request is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum About<'a> {
    /// A session of this name.
    Session(&'a str),
    /// The server.
    Server,
    /// What is nobody's, such as a calculation.
    Nothing,
}

/// What somebody must be allowed to make a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Need<'a> {
    role: Role,
    about: About<'a>,
}

impl<'a> Need<'a> {
    fn of(method: &Method, path: &'a str) -> Self {
        let reads = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
        let role = if reads {
            Role::Spectator
        } else if is_manners(path) || (*method == Method::POST && is_recording(path)) {
            Role::Operator
        } else {
            Role::Admin
        };
        let call = path.strip_prefix("/api/v1/").unwrap_or(path);
        let (first, rest) = call.split_once('/').unwrap_or((call, ""));
        let about = match (first, rest) {
            // Those of whoever asks: the list leaves out the others.
            ("sessions", "") if reads => About::Nothing,
            // Channels and services of those.
            ("", "foxglove") if reads => About::Nothing,
            // The same on every server.
            ("materials", "") if reads => About::Nothing,
            ("sessions", "") => About::Server,
            // It makes another one.
            ("sessions", rest) if rest.ends_with("/duplicate") => About::Server,
            ("sessions", rest) => About::Session(rest.split('/').next().unwrap_or(rest)),
            // Calculations change nothing.
            ("kinematics" | "analysis" | "experiments", _) => {
                return Self {
                    role: Role::Spectator,
                    about: About::Nothing,
                };
            }
            _ => About::Server,
        };
        Self { role, about }
    }

    fn session(&self) -> Option<&'a str> {
        match self.about {
            About::Session(session) => Some(session),
            About::Server | About::Nothing => None,
        }
    }

    fn check(&self, pass: &Pass) -> Result<(), Failure> {
        let Some(own) = &pass.session else {
            return Ok(());
        };
        match self.about {
            About::Session(other) if other != own.as_str() => {
                Err(NOT_ALLOWED.because(format!("the invite is to session {own}")))
            }
            About::Server => Err(NOT_ALLOWED
                .because("this concerns the whole server, and the invite is to one session")),
            _ => check_role(pass, self.role),
        }
    }
}

/// Whether a request stops a session.
pub(crate) fn is_stop(method: &Method, path: &str) -> bool {
    let call = path.strip_prefix("/api/v1/sessions/");
    let call = call.and_then(|call| call.split_once('/'));
    *method == Method::POST && call.is_some_and(|(_, call)| call == "stop")
}

/// Whether a call is one that whoever operates may make: a stop, and what concerns who holds which tool.
fn is_manners(path: &str) -> bool {
    let mut parts = path.trim_start_matches("/api/v1/").split('/').skip(2);
    match (parts.next(), parts.next(), parts.next(), parts.next()) {
        (Some("stop"), None, None, None) | (Some("stop"), Some("clear"), None, None) => true,
        (Some("tools"), Some(_), Some(word), None) => {
            matches!(word, "request" | "withdraw" | "grant" | "deny" | "release")
        }
        _ => false,
    }
}

/// Whether a path begins or ends a recording: as operators may who move what is recorded. To delete one is an admin's.
fn is_recording(path: &str) -> bool {
    let mut parts = path.trim_start_matches("/api/v1/").split('/').skip(2);
    matches!(
        (parts.next(), parts.next(), parts.next(), parts.next()),
        (Some("recordings"), None, None, None) | (Some("recordings"), Some(_), Some("stop"), None)
    )
}

/// Whether a pass is one of this role, or of a further one.
///
/// # Errors
/// It is not.
pub(crate) fn check_role(pass: &Pass, needed: Role) -> Result<(), Failure> {
    if needed <= pass.role {
        return Ok(());
    }
    let words = format!(
        "this takes the role {needed}, and the invite is for the role {}",
        pass.role
    );
    Err(NOT_ALLOWED.because(words))
}

/// Whether a pass is good for a call of `/api/v1`, whatever way it is made.
///
/// # Errors
/// It is not.
pub(crate) fn check_call(pass: &Pass, method: &Method, path: &str) -> Result<(), Failure> {
    Need::of(method, path).check(pass)
}

/// Tells browsers that pages of the configured origins may read answers; nothing when there are none.
pub(crate) fn cross_origin(config: &ApiConfig) -> Option<CorsLayer> {
    let origins: Vec<HeaderValue> = config
        .allowed_origins
        .iter()
        .filter_map(|origin| origin.parse().ok())
        .collect();
    (!origins.is_empty()).then(|| {
        CorsLayer::new()
            .allow_origin(origins)
            .allow_methods([Method::GET, Method::POST, Method::PATCH, Method::DELETE])
            .allow_headers([header::AUTHORIZATION, header::CONTENT_TYPE])
            .expose_headers([header::LOCATION, header::RETRY_AFTER])
    })
}

fn check_host_and_origin(config: &ApiConfig, request: &Request) -> Result<(), Failure> {
    let host = host(request.uri(), request.headers())?;
    if !config.doors.needs_token() && !is_loopback(&host) {
        return Err(HOST.because(format!(
            "the request is for {host}; without a token only localhost and loopback addresses are served"
        )));
    }
    if must_show_origin(request) {
        check_origin(&config.allowed_origins, &host, request.headers())?;
    }
    Ok(())
}

/// The host that a request is for. An absolute request target wins over the header, RFC 9112 §3.2.2.
fn host(uri: &Uri, headers: &HeaderMap) -> Result<Authority, Failure> {
    let host = match uri.authority() {
        Some(authority) => authority.clone(),
        None => only(headers, &header::HOST)
            .and_then(|host| Authority::try_from(host.as_bytes()).ok())
            .ok_or_else(|| HOST_MISSING.because("there is no usable Host header, or several"))?,
    };
    if host.as_str().contains('@') {
        return Err(HOST_MISSING.because("the host has a user name in it"));
    }
    let port = &host.as_str()[host.host().len()..];
    if !(port.is_empty() || port[1..].parse::<u16>().is_ok()) {
        return Err(HOST_MISSING.because(format!("{port:?} after the host is no port")));
    }
    Ok(host)
}

fn is_loopback(host: &Authority) -> bool {
    let name = host.host();
    let literal = name
        .strip_prefix('[')
        .and_then(|name| name.strip_suffix(']'))
        .unwrap_or(name);
    name.eq_ignore_ascii_case("localhost")
        || literal
            .parse::<IpAddr>()
            .is_ok_and(|address| address.is_loopback())
}

fn must_show_origin(request: &Request) -> bool {
    let reads = matches!(
        *request.method(),
        Method::GET | Method::HEAD | Method::OPTIONS
    );
    !reads || request.headers().contains_key(header::UPGRADE)
}

/// Programs send no Origin; browsers always do, and `null` when it is nobody's.
fn check_origin(allowed: &[String], host: &Authority, headers: &HeaderMap) -> Result<(), Failure> {
    if !headers.contains_key(header::ORIGIN) {
        return Ok(());
    }
    let origin = only(headers, &header::ORIGIN)
        .and_then(|origin| origin.to_str().ok())
        .unwrap_or_default();
    if is_origin_of(origin, host) || allowed.iter().any(|allowed| allowed == origin) {
        return Ok(());
    }
    Err(ORIGIN.because(format!(
        "the request comes from a page of {origin:?} and is for {host}"
    )))
}

/// Whether a page of this origin was served under this host. Behind a proxy that does TLS the scheme is not known here,
/// so either will do.
fn is_origin_of(origin: &str, host: &Authority) -> bool {
    let authority = ["http://", "https://"]
        .iter()
        .find_map(|scheme| origin.strip_prefix(scheme));
    authority.is_some_and(|authority| authority.eq_ignore_ascii_case(host.as_str()))
}

fn check_token(
    doors: &Doors,
    tries: &Tries,
    peer: Option<Peer>,
    headers: &HeaderMap,
    what: ShownFor,
) -> Result<Pass, Failure> {
    if let Some(pass) = doors.admit(None) {
        return Ok(pass);
    }
    let Some(shown) = shown_token(headers) else {
        return Err(refusal("the request shows none"));
    };
    look_at(doors, tries, peer, shown, what)?
        .ok_or_else(|| refusal("the request shows another one, or an invite that has ended"))
}

/// What a token is good for; nothing where it is a wrong one, which is counted.
///
/// # Errors
/// Too many wrong ones came from there.
pub(crate) fn look_at(
    doors: &Doors,
    tries: &Tries,
    peer: Option<Peer>,
    shown: &str,
    what: ShownFor,
) -> Result<Option<Pass>, Failure> {
    let now = Instant::now();
    // Before it is looked at: whoever guesses must not learn from the answer which guess was right.
    if let Some(wait) = tries.wait(now, peer, shown, what) {
        let wait_s = wait.as_secs_f64().ceil();
        let failure = TOO_MANY_TRIES.because(format!("wait for {wait_s} s"));
        return Err(failure.with_header(header::RETRY_AFTER, HeaderValue::from(wait_s as u64)));
    }
    let pass = doors.admit(Some(shown));
    match pass {
        Some(_) => tries.count_good(peer, shown),
        None => tries.count_wrong(now, peer, what),
    }
    Ok(pass)
}

fn refusal(detail: &str) -> Failure {
    TOKEN.because(detail).with_header(
        header::WWW_AUTHENTICATE,
        HeaderValue::from_static("Bearer realm=\"teleclay\""),
    )
}

fn shown_token(headers: &HeaderMap) -> Option<&str> {
    if headers.contains_key(header::AUTHORIZATION) {
        let (scheme, token) = only(headers, &header::AUTHORIZATION)?
            .to_str()
            .ok()?
            .split_once(' ')?;
        return scheme
            .eq_ignore_ascii_case("bearer")
            .then(|| token.trim_start_matches(' '));
    }
    subprotocols(headers).find_map(|offered| offered.strip_prefix(BEARER_SUBPROTOCOL))
}

/// The subprotocols that a WebSocket offers, in their order.
pub(crate) fn subprotocols(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    headers
        .get_all(header::SEC_WEBSOCKET_PROTOCOL)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(str::trim)
}

/// A header that is there exactly once.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a HeaderValue> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?;
    values.next().is_none().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn authority(text: &str) -> Authority {
        text.parse().unwrap()
    }

    #[test]
    fn only_this_machine_is_loopback() {
        for host in [
            "localhost",
            "LocalHost:8080",
            "127.0.0.1",
            "127.8.9.10:1",
            "[::1]:8080",
            "[::1]",
        ] {
            assert!(is_loopback(&authority(host)), "{host}");
        }
        for host in [
            "localhost.evil.example",
            "evil.example:8080",
            "127.0.0.1.evil.example",
            "0.0.0.0:8080",
            "[::]:8080",
            "192.168.1.7",
            "127.1",
        ] {
            assert!(!is_loopback(&authority(host)), "{host}");
        }
    }

    #[test]
    fn an_origin_is_compared_with_its_port() {
        let host = authority("127.0.0.1:8080");
        assert!(is_origin_of("http://127.0.0.1:8080", &host));
        assert!(is_origin_of("https://LOCALHOST", &authority("localhost")));
        for origin in [
            "null",
            "",
            "http://127.0.0.1",
            "http://127.0.0.1:80800",
            "http://127.0.0.1:8080.evil.example",
            "http://evil.example",
            "file://127.0.0.1:8080",
            "127.0.0.1:8080",
        ] {
            assert!(!is_origin_of(origin, &host), "{origin}");
        }
    }

    #[test]
    fn a_token_is_read_from_either_place_and_never_from_two() {
        let headers = |pairs: &[(HeaderName, &'static str)]| -> HeaderMap {
            let mut headers = HeaderMap::new();
            for (name, value) in pairs {
                headers.append(name, HeaderValue::from_static(value));
            }
            headers
        };
        let shown = |pairs: &[(HeaderName, &'static str)]| {
            shown_token(&headers(pairs)).map(ToOwned::to_owned)
        };
        let some = |text: &str| Some(text.to_owned());
        assert_eq!(shown(&[(header::AUTHORIZATION, "Bearer abc")]), some("abc"));
        assert_eq!(
            shown(&[(header::AUTHORIZATION, "bearer  abc")]),
            some("abc")
        );
        assert_eq!(shown(&[(header::AUTHORIZATION, "Basic abc")]), None);
        assert_eq!(shown(&[(header::AUTHORIZATION, "abc")]), None);
        let offered = (
            header::SEC_WEBSOCKET_PROTOCOL,
            "teleclay.v1, bearer.abc.def",
        );
        assert_eq!(shown(std::slice::from_ref(&offered)), some("abc.def"));
        // Whoever sends the header means it.
        assert_eq!(shown(&[offered, (header::AUTHORIZATION, "Basic x")]), None);
        assert_eq!(
            shown(&[
                (header::AUTHORIZATION, "Bearer abc"),
                (header::AUTHORIZATION, "Bearer def")
            ]),
            None
        );
    }

    #[test]
    fn a_wrong_token_is_refused_whatever_its_length() {
        let check = |shown: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(
                header::AUTHORIZATION,
                format!("Bearer {shown}").parse().unwrap(),
            );
            check_token(
                &Doors::with_token("correct"),
                &Tries::default(),
                None,
                &headers,
                ShownFor::Else,
            )
        };
        assert_eq!(check("correct"), Ok(Pass::of_the_token()));
        for wrong in ["", "correc", "correct ", "correctly", "Correct"] {
            assert!(check(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_stop_is_told_from_everything_else() {
        let stop = "/api/v1/sessions/a/stop";
        assert!(is_stop(&Method::POST, stop));
        assert!(!is_stop(&Method::GET, stop));
        for other in [
            "/api/v1/sessions/a/stop/clear",
            "/api/v1/sessions/stop",
            "/api/v1/sessions/a/b/stop",
            "/api/v1/sessions/a/stop/",
            "/sessions/a/stop",
            "/stop",
        ] {
            assert!(!is_stop(&Method::POST, other), "{other}");
        }
    }

    #[test]
    fn every_path_says_what_it_needs() {
        let need = |method: Method, path: &'static str| {
            let need = Need::of(&method, path);
            (need.role, need.about)
        };
        let (spectator, operator, admin) = (Role::Spectator, Role::Operator, Role::Admin);
        for (method, path, needed) in [
            (Method::GET, "/api/v1/sessions", (spectator, About::Nothing)),
            (
                Method::GET,
                "/api/v1/materials",
                (spectator, About::Nothing),
            ),
            (
                Method::POST,
                "/api/v1/sessions/a/stop",
                (operator, About::Session("a")),
            ),
            (
                Method::POST,
                "/api/v1/sessions/a/stop/clear",
                (operator, About::Session("a")),
            ),
            (
                Method::POST,
                "/api/v1/sessions/a/tools/1/grant",
                (operator, About::Session("a")),
            ),
            (
                Method::POST,
                "/api/v1/sessions/a/tools/1/grant/more",
                (admin, About::Session("a")),
            ),
            (
                Method::POST,
                "/api/v1/sessions/stop/undo",
                (admin, About::Session("stop")),
            ),
            (Method::POST, "/api/v1/sessions", (admin, About::Server)),
            (
                Method::GET,
                "/api/v1/sessions/a",
                (spectator, About::Session("a")),
            ),
            (
                Method::GET,
                "/api/v1/sessions/a/stream",
                (spectator, About::Session("a")),
            ),
            (
                Method::PATCH,
                "/api/v1/sessions/a",
                (admin, About::Session("a")),
            ),
            (
                Method::DELETE,
                "/api/v1/sessions/a/",
                (admin, About::Session("a")),
            ),
            (
                Method::POST,
                "/api/v1/sessions/a/clay/reset",
                (admin, About::Session("a")),
            ),
            (
                Method::POST,
                "/api/v1/kinematics/inverse",
                (spectator, About::Nothing),
            ),
            (Method::GET, "/metrics", (spectator, About::Server)),
            (Method::POST, "/api/v1/what-is-new", (admin, About::Server)),
        ] {
            assert_eq!(need(method, path), needed, "{path}");
        }
        // A name that is written in another way is another name.
        let need = Need::of(&Method::GET, "/api/v1/sessions/%61");
        assert_eq!(need.session(), Some("%61"));
    }
}
