//! What waits for a client.

use std::collections::VecDeque;

/// A whole message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// A text message.
    Text(String),
    /// A binary message.
    Binary(Vec<u8>),
}

impl Message {
    /// Its length, bytes.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::Text(text) => text.len(),
            Self::Binary(bytes) => bytes.len(),
        }
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Messages of which none may be lost.
#[derive(Debug, Default)]
pub(super) struct State {
    messages: VecDeque<Message>,
    bytes: usize,
}

impl State {
    pub(super) fn push(&mut self, message: Message) {
        self.bytes += message.len();
        self.messages.push_back(message);
    }

    pub(super) fn pop(&mut self) -> Option<Message> {
        let message = self.messages.pop_front()?;
        self.bytes -= message.len();
        Some(message)
    }

    pub(super) fn count(&self) -> usize {
        self.messages.len()
    }

    pub(super) const fn bytes(&self) -> usize {
        self.bytes
    }
}

/// The newest samples of one topic.
#[derive(Debug)]
pub(super) struct Samples<P> {
    /// When each was, ns since 1970, and what it is.
    samples: VecDeque<(u64, P)>,
    most: usize,
}

impl<P> Samples<P> {
    pub(super) const fn at_most(most: usize) -> Self {
        Self {
            samples: VecDeque::new(),
            most,
        }
    }

    /// Adds the newest sample; the number that had to give way to it.
    pub(super) fn push(&mut self, time_ns: u64, sample: P) -> u64 {
        self.samples.push_back((time_ns, sample));
        let excess = self.samples.len().saturating_sub(self.most);
        self.samples.drain(..excess);
        excess as u64
    }

    /// When the oldest was, ns.
    pub(super) fn oldest_ns(&self) -> Option<u64> {
        self.samples.front().map(|(time_ns, _)| *time_ns)
    }

    pub(super) fn pop(&mut self) -> Option<(u64, P)> {
        self.samples.pop_front()
    }
}
