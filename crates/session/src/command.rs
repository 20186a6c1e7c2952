//! What a session may be asked to do, what comes of it, and why it may refuse.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use teleclay_proto::http::{ClayReset, FieldError, SessionPatch};

/// Something that a session is asked to do: at once the body of an HTTP call, a text of a WebSocket and a query on
/// Zenoh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case")]
#[expect(
    clippy::large_enum_variant,
    reason = "plain data, made and read outside of the tick, one at a time"
)]
pub enum Command {
    /// Change settings. What the patch leaves out keeps its value.
    Patch {
        /// The change.
        patch: SessionPatch,
    },
    /// Put a fresh block in place of the one that was cut. Ends faults.
    Reset {
        /// Its shape and material; as before where left out.
        reset: ClayReset,
        /// The lease of the operator who asks for it, where an operator does: only who holds a tool may.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lease: Option<u32>,
    },
    /// Give a tool to an operator.
    Join {
        /// Who asks.
        operator: Operator,
    },
    /// Take a tool back from whoever holds this lease.
    Leave {
        /// The lease.
        lease: u32,
    },
    /// Take every tool from whoever holds it, and give none until the stop is cleared. It is never refused: its words
    /// are made to fit, and one that comes while another holds leaves that one's words as they are.
    Stop {
        /// Who stops.
        by: String,
        /// Why, for people.
        reason: String,
    },
    /// Give tools again. Nobody gets one back by it: each operator joins anew.
    ClearStop {
        /// Who clears it.
        by: String,
    },
    /// Ask the holder of a tool for it. It is forgotten after [`Rules::request`](crate::Rules::request), and as soon as
    /// the holder has the tool no longer.
    Request {
        /// The tool's number, from 1.
        tool: u32,
        /// Who wants it.
        operator: String,
    },
    /// Want a tool no longer.
    Withdraw {
        /// The tool's number, from 1.
        tool: u32,
        /// Who had asked for it.
        operator: String,
    },
    /// Hand a tool over to an operator who has asked for it. For [`Rules::reservation`](crate::Rules::reservation)
    /// nobody else gets it.
    Grant {
        /// The tool's number, from 1.
        tool: u32,
        /// Who has asked for it.
        operator: String,
        /// The lease under which the tool is held, where its holder hands it over: so nobody gives away what is
        /// another's by now.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lease: Option<u32>,
    },
    /// Keep a tool from an operator who has asked for it.
    Deny {
        /// The tool's number, from 1.
        tool: u32,
        /// Who has asked for it.
        operator: String,
        /// Why not, for people.
        reason: String,
        /// The lease under which the tool is held, where its holder denies it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lease: Option<u32>,
    },
    /// Take a tool away from its holder.
    Release {
        /// The tool's number, from 1.
        tool: u32,
        /// The lease under which it is to be held, so that nobody takes it from another holder than was meant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lease: Option<u32>,
    },
}

/// Who asks for a tool, and with what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Operator {
    /// The operator's name, for people to read. An operator who was lost gets the same tool back under the same name.
    pub name: String,
    /// What the handle is, for people to read.
    pub device: String,
}

/// What a command has brought about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The revision that the command made.
    pub revision: u64,
    /// The block of clay that the session works on now.
    pub clay_epoch: u32,
    /// The tool that was given, if the command asked for one.
    pub granted: Option<Granted>,
}

/// A tool that was given to an operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Granted {
    /// The lease under which frames are taken. Never 0, and never given twice by one session.
    pub lease: u32,
    /// The slot, from 0.
    pub slot: usize,
}

/// Why a command was not carried out. Nothing has changed then, to the last bit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A field holds what cannot be.
    #[error("{}: {}", .0.pointer, .0.detail)]
    Field(FieldError),
    /// The settings changed between the preparation and the tick: prepare the command again.
    #[error(
        "prepared from the settings of revision {prepared_from}, which are those of revision {settings_from} by now"
    )]
    Overtaken {
        /// Revision of the settings that the command was prepared from.
        prepared_from: u64,
        /// Revision of the settings as they are.
        settings_from: u64,
    },
    /// Every tool is held by somebody who is there.
    #[error("all {tools} tools are held")]
    NoFreeTool {
        /// How many tools the session has.
        tools: usize,
    },
    /// The session is stopped.
    #[error("stopped by {by}: {reason}")]
    Stopped {
        /// Who has stopped it.
        by: Arc<str>,
        /// Why, for people.
        reason: Arc<str>,
    },
    /// The session is not stopped.
    #[error("the session is not stopped")]
    NotStopped,
    /// No tool is free but one that is kept for somebody else.
    #[error("the tool that is free is kept for {holder}")]
    Reserved {
        /// For whom it is kept.
        holder: Arc<str>,
    },
    /// The session has no tool of this number.
    #[error("there is no tool {tool}, only 1 to {tools}")]
    NoSuchTool {
        /// The number.
        tool: u32,
        /// How many tools the session has.
        tools: usize,
    },
    /// Nobody holds this tool.
    #[error("nobody holds tool {tool}")]
    NotHeld {
        /// The tool's number, from 1.
        tool: u32,
    },
    /// Who asks for the tool holds it.
    #[error("{operator} holds tool {tool} already")]
    HeldByAsker {
        /// The tool's number, from 1.
        tool: u32,
        /// Who asks.
        operator: Arc<str>,
    },
    /// Who asks for the tool has asked for it already.
    #[error("{operator} has asked for tool {tool} already")]
    AskedAlready {
        /// The tool's number, from 1.
        tool: u32,
        /// Who asks.
        operator: Arc<str>,
    },
    /// As many as may have asked for the tool.
    #[error("{most} operators have asked for tool {tool} already")]
    TooManyRequests {
        /// The tool's number, from 1.
        tool: u32,
        /// How many may.
        most: usize,
    },
    /// This operator has not asked for this tool, or it was forgotten.
    #[error("{operator} has not asked for tool {tool}")]
    NoSuchRequest {
        /// The tool's number, from 1.
        tool: u32,
        /// Who should have.
        operator: Arc<str>,
    },
    /// Nobody holds this lease, or no longer; or not of this tool.
    #[error("nobody holds lease {lease}")]
    NoSuchLease {
        /// The lease.
        lease: u32,
    },
    /// Clay that was to be exchanged is that of another block by now.
    #[error("made for block {prepared_for}, the session works on block {clay_epoch} by now")]
    OtherClay {
        /// The block that it was made for.
        prepared_for: u32,
        /// The block that is there.
        clay_epoch: u32,
    },
    /// More was cut since the clay to be exchanged was made than a tick can make up for: make it again.
    #[error("more was cut after tick {as_of_tick} than can be made up for")]
    CutMeanwhile {
        /// Up to this tick the clay has everything.
        as_of_tick: u64,
    },
    /// Events of earlier commands were not taken away yet.
    #[error("the session has no room for the events of a further command")]
    Busy,
}
