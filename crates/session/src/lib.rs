//! One session as a pure machine: a block of clay, the tools that cut it, who holds them, and the conditioned line to
//! each.
//!
//! | module | holds |
//! |---|---|
//! | [`Session`] | the machine itself: the order in which to call it stands there |
//! | [`command`] | what a session may be asked to do, and why it may refuse, as plain data |
//! | [`prepare`] | what a command needs built before the tick, and what it leaves to be dropped after it |
//! | [`cuts`] | what was cut in a tick, for whoever keeps it |
//! | [`recovery`] | a session that goes on where an earlier server of it has ended |
//! | [`event`] | what a session tells of itself, and the fold that makes its state of it |
//! | [`in_words`] | what people are told of an event |
//! | [`settings`] | what a session was told to be, and the loop parameters that follow |
//! | [`rules`] | who gets which tool, when a lease ends, and how long a request or a reservation lasts |
//!
//! REST, WebSocket texts and Zenoh queries all speak [`Command`]; logs, watchers and metrics all hear [`Event`]s.
//! Neither knows a rule.
//!
//! *Architecture invariant*: a command is carried out in one tick under one revision, or it changes nothing at all.
//! `now` is an argument; the same commands and frames at the same times give the same bits.

pub mod command;
pub mod cuts;
pub mod event;
pub mod prepare;
pub mod recovery;
pub mod rules;
pub mod settings;

mod requests;
mod session;
mod slot;
mod words;

pub use command::{Command, Operator, Outcome, Refusal};
pub use cuts::ToolCuts;
pub use event::{
    Event, EventKind, Exchange, HolderSnapshot, Release, RequestEnd, Snapshot, StopSnapshot,
    ToolSnapshot,
};
pub use prepare::{ExchangedClay, Prepared};
pub use recovery::Recovery;
pub use rules::Rules;
pub use session::{Session, SessionSetup};
pub use settings::{Lines, Settings, SettingsError};
pub use words::in_words;
