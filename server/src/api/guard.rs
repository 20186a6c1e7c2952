//! Who may ask: host, origin and token, checked before anything else happens.
//!
//! | check | against | applies |
//! |---|---|---|
//! | Host | a name of somebody else's that resolves to this machine, so that their page is "same origin" here | all requests while no token is configured |
//! | Origin | a page from elsewhere that asks on behalf of its visitor; WebSockets are not covered by CORS | requests that change something, and WebSockets |
//! | token | everyone else; after many wrong ones, everybody at that address for a while | `/api/v1` and `/metrics` while one is configured |

use std::net::IpAddr;
use std::time::Instant;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use teleclay_front::{Peer, Tries};
use tower_http::cors::CorsLayer;

use super::problem::{Failure, HOST, HOST_MISSING, ORIGIN, TOKEN, TOO_MANY_TRIES};
use super::{Api, ApiConfig};

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

/// Lets a request through that shows the token, or any while none is configured.
pub(crate) async fn require_token(
    State(api): State<Api>,
    request: Request,
    next: Next,
) -> Response {
    let peer = request.extensions().get::<Peer>().copied();
    let token = api.config().token.as_deref();
    match check_token(token, api.tries(), peer, request.headers()) {
        Ok(()) => next.run(request).await,
        Err(failure) => failure.into_response(),
    }
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
    if config.token.is_none() && !is_loopback(&host) {
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

/// Compares without telling by its duration where two secrets differ.
fn is_same_secret(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let differing = a.iter().zip(b).fold(0_u8, |all, (x, y)| all | (x ^ y));
    a.len() == b.len() && std::hint::black_box(differing) == 0
}

fn check_token(
    token: Option<&str>,
    tries: &Tries,
    peer: Option<Peer>,
    headers: &HeaderMap,
) -> Result<(), Failure> {
    let Some(token) = token else {
        return Ok(());
    };
    let Some(shown) = shown_token(headers) else {
        return Err(refusal("the request shows none"));
    };
    let now = Instant::now();
    // Before it is looked at: whoever guesses must not learn from the answer which guess was right.
    if let Some(wait) = tries.wait(now, peer) {
        let wait_s = wait.as_secs_f64().ceil();
        let failure = TOO_MANY_TRIES.because(format!("wait for {wait_s} s"));
        return Err(failure.with_header(header::RETRY_AFTER, HeaderValue::from(wait_s as u64)));
    }
    if is_same_secret(shown, token) {
        return Ok(());
    }
    tries.count(now, peer);
    Err(refusal("the request shows another one"))
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
            check_token(Some("correct"), &Tries::default(), None, &headers)
        };
        assert_eq!(check("correct"), Ok(()));
        for wrong in ["", "correc", "correct ", "correctly", "Correct"] {
            assert!(check(wrong).is_err(), "{wrong:?}");
        }
    }
}
