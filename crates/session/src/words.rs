//! What a session's events are in words.

use teleclay_proto::watch::Level;

use crate::event::{EventKind, Exchange, Release, RequestEnd, Snapshot};

/// What people are told of an event that finds a session like this; nothing of changes that are seen in the session's
/// state anyway.
pub fn in_words(kind: &EventKind, before: &Snapshot) -> Option<(Level, String)> {
    let operator = |slot: usize| {
        let holder = before.tools[slot].holder.as_ref();
        holder.map_or("the operator", |holder| &holder.operator.name)
    };
    Some(match kind {
        EventKind::Changed { .. } | EventKind::Taken { .. } => return None,
        EventKind::FreshBlock { .. } => (Level::Info, "a fresh block".to_owned()),
        EventKind::Exchanged { exchange, .. } => (
            Level::Info,
            match exchange {
                Exchange::Undone { .. } => "a stroke was undone".to_owned(),
                Exchange::UndoneSince { .. } => "strokes were undone".to_owned(),
                Exchange::Redone { .. } => "a stroke was redone".to_owned(),
            },
        ),
        EventKind::Stopped { by, reason } => (
            Level::Warning,
            format!("{by} has stopped the session: {reason}"),
        ),
        EventKind::StopCleared { by } => (Level::Info, format!("{by} has cleared the stop")),
        EventKind::Requested { slot, operator } => (
            Level::Info,
            format!("{operator} asks for tool {}", tool(*slot)),
        ),
        EventKind::RequestEnded {
            slot,
            operator,
            because,
        } => {
            let why = match because {
                RequestEnd::Denied { reason } => format!("was denied: {reason}"),
                RequestEnd::Withdrawn => "was withdrawn".to_owned(),
                RequestEnd::RanOut => "was not answered".to_owned(),
            };
            let number = tool(*slot);
            (
                Level::Info,
                format!("the request of {operator} for tool {number} {why}"),
            )
        }
        EventKind::ReservationEnded { slot, operator } => (
            Level::Info,
            format!("{operator} did not come: tool {} is free", tool(*slot)),
        ),
        EventKind::Released {
            slot,
            operator,
            because: Release::HandedOver { to },
            ..
        } => (
            Level::Info,
            format!("{} handed tool {} over to {to}", operator.name, tool(*slot)),
        ),
        EventKind::Released {
            slot,
            operator,
            because,
            ..
        } => (
            Level::Info,
            format!(
                "{} {}: tool {} is free",
                operator.name,
                because.words(),
                tool(*slot)
            ),
        ),
        EventKind::Connected { slot } => (
            Level::Info,
            format!("{} holds tool {}", operator(*slot), tool(*slot)),
        ),
        EventKind::Disconnected { slot } => (
            Level::Warning,
            format!(
                "no frame from {}: tool {} stopped",
                operator(*slot),
                tool(*slot)
            ),
        ),
        EventKind::Fault { slot, fault } => (
            Level::Error,
            format!(
                "{fault}, from {}: tool {} rests until somebody joins with it anew, or a fresh block",
                operator(*slot),
                tool(*slot)
            ),
        ),
    })
}

/// Tools are numbered from 1.
const fn tool(slot: usize) -> usize {
    slot + 1
}
