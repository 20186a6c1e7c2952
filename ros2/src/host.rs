//! What a server has to be, that its sessions can be told of: this room knows no server.

use std::future::Future;

use teleclay_wire::TelemetrySample;
use tokio::sync::{broadcast, watch};

/// A server.
pub trait Host: Send + Sync + 'static {
    /// One of its sessions.
    type Session: HostSession;

    /// Those that there are.
    fn sessions(&self) -> Vec<Self::Session>;

    /// Is told whenever a session has come or gone.
    fn changes(&self) -> watch::Receiver<u64>;
}

/// A session.
pub trait HostSession: Clone + Send + Sync + 'static {
    /// A moment of a tool.
    type Sample: Clone + Send + Into<Sample>;
    /// Something that happened.
    type Event: Clone + Send + Into<Event>;

    /// Its id.
    fn name(&self) -> &str;

    /// What tells it from one that had the id before.
    fn number(&self) -> u32;

    /// Moments of its tools from now on.
    fn telemetry(&self) -> broadcast::Receiver<Self::Sample>;

    /// What happens from now on.
    fn events(&self) -> broadcast::Receiver<Self::Event>;

    /// What changes slowly.
    fn look(&self) -> Look;

    /// Does what was asked for, as far as the session lets it; tells what is now, or why not.
    fn carry_out(&self, call: Call) -> impl Future<Output = Result<String, String>> + Send;
}

/// One moment of a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The tool's number, from 1.
    pub tool: u32,
    /// Time since the session began, s.
    pub time_s: f64,
    /// What was measured.
    pub sample: TelemetrySample,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// How grave it is.
    pub level: Level,
    /// What happened, for people.
    pub text: String,
    /// When, since the session began, s.
    pub time_s: f64,
}

/// How grave something is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Nothing to do.
    #[default]
    Fine,
    /// Somebody should look.
    Warning,
    /// Something went wrong.
    Error,
}

/// What changes slowly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    /// Where the handle's origin lies in the clay's frame, m.
    pub home_m: [f64; 3],
    /// Every tool, by number.
    pub tools: Vec<ToolLook>,
    /// Counts the changes of the settings.
    pub revision: u64,
    /// The settings as JSON.
    pub settings: String,
    /// How grave its condition is.
    pub level: Level,
    /// The condition in a word or two.
    pub condition: String,
    /// Figures under their names.
    pub figures: Vec<(&'static str, String)>,
}

/// What of a tool changes slowly.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ToolLook {
    /// Who holds it; empty while it is free.
    pub operator: String,
    /// Whether frames come.
    pub is_connected: bool,
}

/// What a session may be asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Call {
    /// Hold all tools, or go on.
    Pause(bool),
    /// Begin with a fresh block.
    ResetClay,
    /// Couple hands and tools by another scheme, by its word.
    SetScheme(String),
}

impl std::fmt::Display for Call {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Pause(true) => f.write_str("pause"),
            Self::Pause(false) => f.write_str("go on"),
            Self::ResetClay => f.write_str("fresh block"),
            Self::SetScheme(scheme) => write!(f, "scheme {scheme:?}"),
        }
    }
}
