//! HTTP, WebSocket, OpenAPI, metrics and the dashboard.
//!
//! | module | holds |
//! |---|---|
//! | [`sessions`], [`clay`], [`theory`] | the calls of `/api/v1` |
//! | [`manners`] | who holds which tool, and the stop |
//! | [`stream`], [`foxglove`] | the WebSockets |
//! | [`socket`] | what each of them is held to |
//! | [`health`], [`metrics`] | probes |
//! | [`openapi`], [`docs`] | the description of all of it, and the page to browse it |
//! | [`dashboard`], [`pages`] | what browsers see at `/` |
//! | [`guard`] | host, origin and token |
//! | [`problem`] | every way to fail |
//! | [`body`] | what comes in, checked |
//! | [`range`] | which part of a file is asked for |
//! | [`http_metrics`] | what the interface counts of itself |
//!
//! A request passes, from the outside in: headers for the answer, the count, a net for panics, the time limit, host and
//! origin, and under `/api/v1` the token. Whatever fails anywhere answers with a problem.

mod body;
mod clay;
mod config;
mod dashboard;
mod docs;
mod foxglove;
mod guard;
mod health;
mod history;
mod http_metrics;
mod import;
mod manners;
mod materials;
mod metrics;
mod openapi;
mod pages;
mod problem;
mod range;
mod recordings;
mod sessions;
mod socket;
mod stream;
mod theory;
mod watchers;

use std::any::Any;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, OriginalUri, Request};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use teleclay_front::Tries;
use tokio::sync::Semaphore;
use tokio::time::timeout;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::openapi::OpenApi;
use utoipa_axum::router::OpenApiRouter;

use self::body::MAX_BODY;
use self::http_metrics::HttpMetrics;
use self::problem::{Failure, INTERNAL, METHOD, NO_ANSWER, path_of};
use self::theory::ComputePool;
use self::watchers::Watchers;
use crate::directory::Directory;

pub use self::config::ApiConfig;
pub use teleclay_front::{Service, bind, serve};

/// Streams that may be open at once, of all sessions: at 2 Mbit/s each, what a fast wired link carries.
const MAX_WATCHERS: usize = 64;

/// Models of the clay that may be made or on their way at once. The largest clay has one of a hundred megabytes.
const MAX_MODELS: usize = 2;

/// Longest wait for an answer to begin. A change waits for the loop, which takes it up within milliseconds.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);

/// Said of every answer that does not say otherwise. An answer of the interface is no page: it loads nothing, stands in
/// no frame and is not kept.
const HEADERS: [(HeaderName, &str); 7] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; frame-ancestors 'none'",
    ),
    (header::CACHE_CONTROL, "no-store"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        "same-origin",
    ),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

/// The interface as it is served: a stop is heard where nothing else finds a place any more.
pub fn service(directory: Directory, config: ApiConfig) -> Service {
    Service {
        router: router(directory, config),
        is_urgent: |method, asked| guard::is_stop(method, asked.path()),
    }
}

/// Everything that the server answers over HTTP.
fn router(directory: Directory, config: ApiConfig) -> Router {
    let api = Api::new(directory, config);
    let token = from_fn_with_state(api.clone(), guard::require_token);
    let guarded = |calls: Router<Api>| {
        calls
            .method_not_allowed_fallback(wrong_method)
            .layer(token.clone())
    };
    let router = Router::new()
        .nest("/api/v1", guarded(calls_of_version_1().into()))
        .merge(guarded(metrics::routes().into()))
        .merge(guarded(foxglove::routes()))
        .merge(Router::from(open_calls()))
        .merge(docs::routes())
        .merge(pages::routes())
        .merge(dashboard::routes())
        .method_not_allowed_fallback(wrong_method)
        .layer(DefaultBodyLimit::max(MAX_BODY));
    let router = match guard::cross_origin(api.config()) {
        Some(layer) => router.layer(layer),
        None => router,
    };
    // The last one stands outermost.
    router
        .layer(from_fn_with_state(
            api.clone(),
            guard::require_host_and_origin,
        ))
        .layer(from_fn(limit_time))
        .layer(CatchPanicLayer::custom(explain_panic))
        .layer(from_fn_with_state(api.clone(), http_metrics::count))
        .layer(from_fn(add_headers))
        .with_state(api)
}

/// The OpenAPI document of a server of this version.
pub fn description(version: &str) -> OpenApi {
    let calls = OpenApiRouter::new()
        .nest("/api/v1", calls_of_version_1())
        .merge(metrics::routes())
        .merge(open_calls())
        .into_openapi();
    openapi::document(calls, version)
}

fn calls_of_version_1() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .merge(sessions::routes())
        .merge(clay::routes())
        .merge(history::routes())
        .merge(import::routes())
        .merge(manners::routes())
        .merge(materials::routes())
        .merge(recordings::routes())
        .merge(theory::routes())
        .merge(stream::routes())
}

fn open_calls() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .merge(health::routes())
        .merge(openapi::routes())
}

/// What every call works on. Copies are the same.
#[derive(Clone)]
pub(crate) struct Api(Arc<Inner>);

struct Inner {
    directory: Directory,
    config: ApiConfig,
    metrics: HttpMetrics,
    tries: Tries,
    watcher_places: Arc<Semaphore>,
    watchers: Watchers,
    model_places: Arc<Semaphore>,
    compute: ComputePool,
    /// The OpenAPI document, as it is sent.
    document: Bytes,
}

impl Api {
    fn new(directory: Directory, config: ApiConfig) -> Self {
        let document = serde_json::to_vec(&description(&config.version))
            .expect("every map in it has strings as keys");
        Self(Arc::new(Inner {
            directory,
            config,
            metrics: HttpMetrics::default(),
            tries: Tries::default(),
            watcher_places: Arc::new(Semaphore::new(MAX_WATCHERS)),
            watchers: Watchers::default(),
            model_places: Arc::new(Semaphore::new(MAX_MODELS)),
            compute: ComputePool::default(),
            document: document.into(),
        }))
    }

    pub(crate) fn directory(&self) -> &Directory {
        &self.0.directory
    }

    pub(crate) fn config(&self) -> &ApiConfig {
        &self.0.config
    }

    pub(crate) fn metrics(&self) -> &HttpMetrics {
        &self.0.metrics
    }

    /// Wrong tokens that were shown.
    pub(crate) fn tries(&self) -> &Tries {
        &self.0.tries
    }

    pub(crate) fn watchers(&self) -> &Watchers {
        &self.0.watchers
    }

    pub(crate) fn watcher_places(&self) -> &Arc<Semaphore> {
        &self.0.watcher_places
    }

    pub(crate) fn model_places(&self) -> &Arc<Semaphore> {
        &self.0.model_places
    }

    pub(crate) fn compute(&self) -> &ComputePool {
        &self.0.compute
    }

    pub(crate) fn document(&self) -> &Bytes {
        &self.0.document
    }
}

/// Lets a change run to its end, also when who asked for it goes away meanwhile: half a change would be worse than
/// either.
pub(crate) async fn see_through<T: Send + 'static>(
    change: impl Future<Output = T> + Send + 'static,
) -> Result<T, Failure> {
    tokio::spawn(change)
        .await
        .map_err(|_| INTERNAL.because("the change was broken off"))
}

async fn wrong_method(OriginalUri(asked): OriginalUri, method: Method) -> Failure {
    METHOD.because(format!("{} does not offer {method}", path_of(&asked)))
}

/// A file may take its time to arrive, and an hour of history to be told again.
fn patience(request: &Request) -> Duration {
    let path = request.uri().path();
    let is_of_the_past = path.ends_with("/undo")
        || path.ends_with("/redo")
        || request
            .uri()
            .query()
            .is_some_and(|query| query.contains("at_s="));
    match *request.method() {
        Method::PUT => 12 * REQUEST_TIMEOUT,
        _ if is_of_the_past => 6 * REQUEST_TIMEOUT,
        _ => REQUEST_TIMEOUT,
    }
}

async fn limit_time(request: Request, next: Next) -> Response {
    let patience = patience(&request);
    timeout(patience, next.run(request))
        .await
        .unwrap_or_else(|_| {
            let waited = format!("waited {} s for it", REQUEST_TIMEOUT.as_secs());
            NO_ANSWER.because(waited).into_response()
        })
}

async fn add_headers(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    for (name, value) in HEADERS {
        response
            .headers_mut()
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    }
    response
}

fn explain_panic(panic: Box<dyn Any + Send>) -> Response {
    let words = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no words");
    tracing::error!("a call panicked: {words}");
    INTERNAL.because("the call broke off").into_response()
}
