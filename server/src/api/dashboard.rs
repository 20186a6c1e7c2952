//! The dashboard, as it was built into the program, at `/`.

use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use rust_embed::{EmbeddedFile, RustEmbed};

use super::Api;
use super::pages;
use super::problem::{NO_SUCH_PATH, path_of};

/// What `npm run build` made. The server builds without it, and then says so.
#[derive(RustEmbed)]
#[folder = "../client-web/dist"]
#[allow_missing = true]
struct Built;

/// Finds a file of the dashboard by its path.
type Find = fn(&str) -> Option<EmbeddedFile>;

const INDEX: &str = "index.html";

/// Below this the bundler names files by their content.
const HASHED: &str = "assets/";

/// Scripts, workers and connections from here and nowhere else. WebAssembly may be compiled, JavaScript out of strings
/// may not. Plots set the sizes of their parts as inline styles.
const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
     font-src 'self'; connect-src 'self'; worker-src 'self' blob:; manifest-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// `/`, and every file of the dashboard.
pub(crate) fn routes() -> Router<Api> {
    Router::new()
        .route(
            "/",
            get(|request: Request| async move { serve(Built::get, &request) }),
        )
        .fallback(|request: Request| async move { serve(Built::get, &request) })
}

fn serve(find: Find, request: &Request) -> Response {
    let path = request.uri().path().trim_start_matches('/');
    if !matches!(*request.method(), Method::GET | Method::HEAD) || path.starts_with("api/") {
        return nothing_at(request);
    }
    if path.is_empty() || path == INDEX {
        return index(find, request);
    }
    if let Some(found) = find(path) {
        return file(path, found, request.headers());
    }
    // The page has addresses of its own, and may be opened at any of them; but a script that is not there is not a
    // page.
    if is_navigation(request.headers()) {
        return index(find, request);
    }
    nothing_at(request)
}

fn index(find: Find, request: &Request) -> Response {
    match find(INDEX) {
        Some(index) => file(INDEX, index, request.headers()),
        None => pages::not_built(),
    }
}

fn file(path: &str, file: EmbeddedFile, asked: &HeaderMap) -> Response {
    let tag = etag(&file);
    let mut response = if is_current(asked, &tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        file.data.into_owned().into_response()
    };
    let headers = response.headers_mut();
    let caching = if path.starts_with(HASHED) {
        "public, max-age=31536000, immutable"
    } else {
        "no-cache"
    };
    for (name, value) in [
        // With the policy on openers, which every answer has, it isolates the page: a worker can then sleep to the
        // fraction of a millisecond.
        (
            HeaderName::from_static("cross-origin-embedder-policy"),
            "require-corp",
        ),
        (header::CACHE_CONTROL, caching),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CONTENT_TYPE, file.metadata.mimetype()),
    ] {
        if let Ok(value) = HeaderValue::from_str(value) {
            headers.insert(name, value);
        }
    }
    headers.insert(header::ETAG, tag);
    response
}

/// A strong tag: the file's own hash.
fn etag(file: &EmbeddedFile) -> HeaderValue {
    let digits: String = file.metadata.sha256_hash()[..16]
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    HeaderValue::from_str(&format!("\"{digits}\"")).expect("hexadecimal digits and quotes")
}

fn is_current(asked: &HeaderMap, tag: &HeaderValue) -> bool {
    asked
        .get_all(header::IF_NONE_MATCH)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .any(|known| known.trim().trim_start_matches("W/") == tag)
}

fn is_navigation(asked: &HeaderMap) -> bool {
    asked
        .get(header::ACCEPT)
        .and_then(|accept| accept.to_str().ok())
        .is_some_and(|accept| accept.contains("text/html"))
}

fn nothing_at(request: &Request) -> Response {
    NO_SUCH_PATH
        .because(format!("nothing is served at {}", path_of(request.uri())))
        .into_response()
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use axum::body::Body;
    use rust_embed::Metadata;

    use super::*;

    fn built(path: &str) -> Option<EmbeddedFile> {
        let (content, kind) = match path {
            "index.html" => ("<!doctype html>", "text/html"),
            "assets/main-1a2b.js" => ("run()", "text/javascript"),
            "assets/page-3c4d.wasm" => ("\0asm", "application/wasm"),
            "favicon.svg" => ("<svg/>", "image/svg+xml"),
            _ => return None,
        };
        Some(EmbeddedFile {
            data: Cow::Borrowed(content.as_bytes()),
            metadata: Metadata::__rust_embed_new([7; 32], None, None, kind),
        })
    }

    fn not_built(_: &str) -> Option<EmbeddedFile> {
        None
    }

    fn ask(find: Find, method: &str, path: &str, headers: &[(HeaderName, &str)]) -> Response {
        let mut request = Request::builder().method(method).uri(path);
        for (name, value) in headers {
            request = request.header(name, *value);
        }
        serve(find, &request.body(Body::empty()).unwrap())
    }

    fn header_of(response: &Response, name: HeaderName) -> &str {
        response.headers()[name].to_str().unwrap()
    }

    #[test]
    fn the_page_is_asked_for_again_and_its_parts_are_kept_for_ever() {
        let page = ask(built, "GET", "/", &[]);
        assert_eq!(page.status(), 200);
        assert_eq!(header_of(&page, header::CACHE_CONTROL), "no-cache");
        assert_eq!(header_of(&page, header::CONTENT_TYPE), "text/html");
        let script = ask(built, "GET", "/assets/main-1a2b.js", &[]);
        assert!(header_of(&script, header::CACHE_CONTROL).contains("immutable"));
        assert_eq!(header_of(&script, header::CONTENT_TYPE), "text/javascript");
        let icon = ask(built, "GET", "/favicon.svg", &[]);
        assert_eq!(header_of(&icon, header::CACHE_CONTROL), "no-cache");
    }

    /// A browser compiles a module as it comes in only if it is called one, and in a page that allows it; page and
    /// worker each have the policy that they came with.
    #[test]
    fn a_module_may_be_compiled_and_no_text_may_become_code() {
        let module = ask(built, "GET", "/assets/page-3c4d.wasm", &[]);
        assert_eq!(header_of(&module, header::CONTENT_TYPE), "application/wasm");
        for path in ["/", "/assets/main-1a2b.js"] {
            let page = ask(built, "GET", path, &[]);
            let policy = header_of(&page, header::CONTENT_SECURITY_POLICY);
            let scripts = policy
                .split("; ")
                .find(|rule| rule.starts_with("script-src "));
            assert_eq!(
                scripts,
                Some("script-src 'self' 'wasm-unsafe-eval'"),
                "{path}"
            );
        }
    }

    #[test]
    fn a_file_that_is_known_is_not_sent_again() {
        let tag = header_of(&ask(built, "GET", "/", &[]), header::ETAG).to_owned();
        for known in [tag.clone(), format!("\"other\", W/{tag}")] {
            let again = ask(built, "GET", "/", &[(header::IF_NONE_MATCH, &known)]);
            assert_eq!(again.status(), 304, "{known}");
        }
        let changed = ask(built, "GET", "/", &[(header::IF_NONE_MATCH, "\"other\"")]);
        assert_eq!(changed.status(), 200);
    }

    #[test]
    fn only_who_wants_a_page_gets_one_for_an_unknown_path() {
        let navigation = [(header::ACCEPT, "text/html,application/xhtml+xml")];
        assert_eq!(ask(built, "GET", "/robot", &navigation).status(), 200);
        for (method, path, headers) in [
            ("GET", "/robot", &[][..]),
            ("GET", "/assets/gone.js", &[(header::ACCEPT, "*/*")][..]),
            ("GET", "/api/v2", &navigation[..]),
            ("POST", "/robot", &navigation[..]),
        ] {
            let response = ask(built, method, path, headers);
            assert_eq!(response.status(), 404, "{method} {path}");
            assert_eq!(
                header_of(&response, header::CONTENT_TYPE),
                "application/problem+json"
            );
        }
    }

    #[tokio::test]
    async fn without_a_dashboard_the_page_says_how_to_build_it() {
        let page = ask(not_built, "GET", "/", &[]);
        assert_eq!(page.status(), 200);
        assert!(header_of(&page, header::CONTENT_TYPE).starts_with("text/html"));
        let body = axum::body::to_bytes(page.into_body(), 10_000)
            .await
            .unwrap();
        assert!(String::from_utf8_lossy(&body).contains("npm run build"));
    }
}
