//! What came, until the tick for which it came in time. A fixed length: of more, the oldest goes.

use std::collections::VecDeque;

/// Things with the time at which they came, oldest first.
#[derive(Clone, Debug)]
pub(crate) struct Inbox<T> {
    waiting: VecDeque<(u64, T)>,
    room: usize,
}

impl<T> Inbox<T> {
    pub(crate) fn new(room: usize) -> Self {
        Self {
            waiting: VecDeque::with_capacity(room),
            room,
        }
    }

    /// Whether there was room for it without forgetting another.
    pub(crate) fn push(&mut self, at_ns: u64, thing: T) -> bool {
        let is_full = self.waiting.len() == self.room;
        if is_full {
            self.waiting.pop_front();
        }
        self.waiting.push_back((at_ns, thing));
        !is_full
    }

    /// The next that had come by `now_ns`.
    pub(crate) fn pop(&mut self, now_ns: u64) -> Option<(u64, T)> {
        let (at_ns, _) = self.waiting.front()?;
        if *at_ns <= now_ns {
            self.waiting.pop_front()
        } else {
            None
        }
    }

    pub(crate) fn clear(&mut self) {
        self.waiting.clear();
    }
}
