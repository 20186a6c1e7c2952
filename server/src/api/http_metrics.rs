//! What the interface counts of itself, for [`metrics`](super::metrics).

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;
use teleclay_proto::SessionId;

use super::Api;

/// A request as it is counted. Everything in it comes from a short list, so that no caller can make it grow.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Answered {
    pub(crate) method: &'static str,
    pub(crate) route: Arc<str>,
    pub(crate) status: u16,
}

/// Counts since the process started.
#[derive(Default)]
pub(crate) struct HttpMetrics {
    answered: Mutex<BTreeMap<Answered, u64>>,
    watchers: Mutex<BTreeMap<SessionId, u64>>,
    visitors: AtomicU64,
    ended: Mutex<BTreeMap<&'static str, u64>>,
    sent_bytes: AtomicU64,
    dropped: AtomicU64,
    forgotten: AtomicU64,
}

impl HttpMetrics {
    pub(crate) fn answered(&self) -> BTreeMap<Answered, u64> {
        copy(&self.answered)
    }

    /// Watchers now, by session.
    pub(crate) fn watchers(&self) -> BTreeMap<SessionId, u64> {
        copy(&self.watchers)
    }

    /// Clients of Foxglove's protocol now.
    pub(crate) fn visitors(&self) -> u64 {
        self.visitors.load(Ordering::Relaxed)
    }

    /// Streams that have ended, by reason.
    pub(crate) fn ended(&self) -> BTreeMap<&'static str, u64> {
        copy(&self.ended)
    }

    pub(crate) fn count_ended(&self, reason: &'static str) {
        add(&self.ended, reason);
    }

    /// Bytes of messages that were handed to streams.
    pub(crate) fn sent_bytes(&self) -> u64 {
        self.sent_bytes.load(Ordering::Relaxed)
    }

    pub(crate) fn count_sent(&self, bytes: usize) {
        self.sent_bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// Telemetry samples that watchers were too slow for.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    pub(crate) fn count_dropped(&self, samples: u32) {
        self.dropped.fetch_add(samples.into(), Ordering::Relaxed);
    }

    /// Frames for hands whose sockets were not read.
    pub(crate) fn forgotten(&self) -> u64 {
        self.forgotten.load(Ordering::Relaxed)
    }

    pub(crate) fn count_forgotten(&self, frames: u64) {
        self.forgotten.fetch_add(frames, Ordering::Relaxed);
    }
}

/// Counts one watcher for as long as it lives.
pub(crate) struct Watching {
    api: Api,
    session: SessionId,
}

impl Watching {
    pub(crate) fn begin(api: Api, session: SessionId) -> Self {
        add(&api.metrics().watchers, session.clone());
        Self { api, session }
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        let mut watchers = lock(&self.api.metrics().watchers);
        if let Some(count) = watchers.get_mut(&self.session) {
            *count -= 1;
            if *count == 0 {
                watchers.remove(&self.session);
            }
        }
    }
}

/// Counts one client of Foxglove's protocol for as long as it is there.
pub(crate) struct Visiting(Api);

impl Visiting {
    pub(crate) fn begin(api: Api) -> Self {
        api.metrics().visitors.fetch_add(1, Ordering::Relaxed);
        Self(api)
    }
}

impl Drop for Visiting {
    fn drop(&mut self) {
        self.0.metrics().visitors.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Counts a request once it is answered, and logs it.
pub(crate) async fn count(State(api): State<Api>, request: Request, next: Next) -> Response {
    let asked = Instant::now();
    let method = request.method().clone();
    let route: Arc<str> = request
        .extensions()
        .get::<MatchedPath>()
        .map_or_else(|| Arc::from("other"), |path| Arc::from(path.as_str()));
    let response = next.run(request).await;
    let answered = Answered {
        method: method_word(&method),
        route,
        status: response.status().as_u16(),
    };
    tracing::debug!(
        method = answered.method,
        route = &*answered.route,
        status = answered.status,
        took_s = asked.elapsed().as_secs_f64(),
        "answered"
    );
    add(&api.metrics().answered, answered);
    response
}

fn method_word(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

fn add<K: Ord>(counts: &Mutex<BTreeMap<K, u64>>, key: K) {
    *lock(counts).entry(key).or_default() += 1;
}

fn copy<K: Ord + Clone>(counts: &Mutex<BTreeMap<K, u64>>) -> BTreeMap<K, u64> {
    lock(counts).clone()
}

/// A count stays a count when somebody panicked beside it.
fn lock<T>(counts: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    counts.lock().unwrap_or_else(PoisonError::into_inner)
}
