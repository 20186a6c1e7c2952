//! The few pages that the server writes itself: the catalogue of problems, and what stands in for a dashboard that is
//! not built. They need nothing but themselves.

use std::fmt::Write as _;

use axum::Router;
use axum::extract::Path;
use axum::extract::rejection::PathRejection;
use axum::http::{Uri, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;

use super::Api;
use super::problem::{Failure, KINDS, Kind, NO_SUCH_PATH, path_of};

/// Styles stand in the page itself; nothing else is loaded.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const STYLE: &str = ":root{color-scheme:light dark}\
    body{font:1rem/1.6 system-ui,sans-serif;max-width:44rem;margin:3rem auto;padding:0 1rem}\
    h1{font-size:1.5rem}code,pre{font:0.95em ui-monospace,monospace}\
    pre{padding:0.8rem 1rem;border:1px solid;border-radius:0.4rem;overflow:auto}\
    table{border-collapse:collapse}td,th{padding:0.3rem 1rem 0.3rem 0;text-align:left;vertical-align:top}";

/// The catalogue of problems: each type is an address, and somebody may open it.
pub(crate) fn routes() -> Router<Api> {
    Router::new()
        .route("/problems", get(catalogue))
        .route("/problems/{word}", get(explanation))
}

/// What `/` says while there is no dashboard.
pub(crate) fn not_built() -> Response {
    page(
        "The dashboard is not built",
        "<p>This server was built without its dashboard, and works all the same: \
         the interface is at <a href=\"api/docs\">/api/docs</a>.</p>\
         <p>To have the dashboard, build it and then the server again; or let one command do both:</p>\
         <pre>rustup target add wasm32-unknown-unknown\ncd client-web\nnpm ci\nnpm run build\ncd ..\ncargo build --release</pre>\
         <pre>cargo demo</pre>",
    )
}

async fn catalogue() -> Response {
    let mut rows = String::new();
    for Kind {
        word,
        title,
        status,
        ..
    } in KINDS
    {
        // Writing to a String cannot fail.
        let _ = write!(
            rows,
            "<tr><td>{}</td><td><a href=\"problems/{word}\"><code>{word}</code></a></td><td>{title}</td></tr>",
            status.as_u16()
        );
    }
    page(
        "Problems",
        &format!(
            "<p>Errors of the interface are problem details, RFC 9457. Their types are the addresses of these pages.</p>\
             <table><tr><th>status</th><th>type</th><th>title</th></tr>{rows}</table>"
        ),
    )
}

async fn explanation(
    asked: Uri,
    word: Result<Path<String>, PathRejection>,
) -> Result<Response, Failure> {
    let kind = word
        .ok()
        .and_then(|Path(word)| KINDS.iter().find(|kind| kind.word == word))
        .ok_or_else(|| {
            NO_SUCH_PATH.because(format!(
                "no problem is explained at {}; /problems lists them",
                path_of(&asked)
            ))
        })?;
    Ok(page(
        kind.title,
        &format!(
            "<p>{}</p><p>Type <code>/problems/{}</code>, status {}.</p><p><a href=\"../problems\">All problems</a></p>",
            escape(kind.meaning),
            kind.word,
            kind.status.as_u16()
        ),
    ))
}

fn page(title: &str, body: &str) -> Response {
    let headers = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    let html = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>{title} · teleclay</title>\
         <style>{STYLE}</style></head><body><h1>{title}</h1>{body}</body></html>\n"
    );
    (headers, Html(html)).into_response()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
