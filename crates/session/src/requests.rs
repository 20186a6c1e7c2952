//! Who has asked for a tool: a bounded list that never gives memory back on a tick.
//!
//! What is forgotten stays behind those who still ask, and leaves when somebody asks anew in its place.

use std::sync::Arc;
use std::time::Duration;

use teleclay_link::time::Timestamp;

/// Most operators who ask for one tool at a time: as many as a session can have.
pub(crate) const MAX_REQUESTS: usize = teleclay_proto::http::MAX_TOOLS as usize;

struct Request {
    operator: Arc<str>,
    since: Timestamp,
}

pub(crate) struct Requests {
    /// The first `asking` of these count, the oldest first.
    places: Vec<Request>,
    asking: usize,
}

impl Requests {
    pub(crate) fn new() -> Self {
        Self {
            places: Vec::with_capacity(MAX_REQUESTS),
            asking: 0,
        }
    }

    /// Who asks, the first one first.
    pub(crate) fn names(&self) -> impl Iterator<Item = &Arc<str>> {
        self.places[..self.asking]
            .iter()
            .map(|request| &request.operator)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.asking == 0
    }

    pub(crate) fn is_full(&self) -> bool {
        MAX_REQUESTS <= self.asking
    }

    pub(crate) fn has(&self, operator: &str) -> bool {
        self.names().any(|name| **name == *operator)
    }

    /// Takes `operator` in, behind all others; there is room. Gives a name that is to be dropped elsewhere.
    pub(crate) fn push(&mut self, operator: Arc<str>, since: Timestamp) -> Option<Arc<str>> {
        let request = Request { operator, since };
        let before = match self.places.get_mut(self.asking) {
            Some(place) => Some(std::mem::replace(place, request).operator),
            None => {
                self.places.push(request);
                None
            }
        };
        self.asking += 1;
        before
    }

    /// Forgets `operator`'s request. The name as it was taken in, or `None` where there is no such request.
    pub(crate) fn forget(&mut self, operator: &str) -> Option<Arc<str>> {
        let at = self.names().position(|name| **name == *operator)?;
        let operator = Arc::clone(&self.places[at].operator);
        self.places[at..self.asking].rotate_left(1);
        self.asking -= 1;
        Some(operator)
    }

    pub(crate) fn forget_all(&mut self) {
        self.asking = 0;
    }

    /// Who has asked first, and how long ago.
    pub(crate) fn oldest(&self, now: Timestamp) -> Option<(&Arc<str>, Duration)> {
        let oldest = self.places[..self.asking].first()?;
        Some((&oldest.operator, now.since(oldest.since)))
    }
}
