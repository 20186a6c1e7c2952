//! The JSON types of `/api/v1`; the WebSocket's text messages and the join carry the same ones.
//!
//! What comes in is parsed by [`parse`], which names the field at fault by its JSON pointer and checks every range;
//! what goes out is written by serde. Unknown fields are errors. A request may leave out what has a default; a PATCH
//! may leave out anything, and what is left out keeps its value.

mod body;
mod clay;
mod hash;
mod health;
mod history;
mod manners;
mod materials;
mod network;
mod operation;
mod patch;
mod problem;
mod read;
mod recording;
mod schema;
mod session;
pub mod theory;

pub use crate::validate::{FieldError, Validate, readable};
pub use body::{BodyError, parse};
pub use clay::{
    ClayReset, ClayShape, ClaySpec, Layer, MAX_LAYERS, MAX_STEPS, MAX_VOXELS, MAX_VOXELS_PER_AXIS,
};
pub use hash::{ClayHash, ClayHashError};
pub use health::{Health, HealthStatus, Readiness};
pub use history::{
    DamagedSession, DamagedState, Duplicate, History, ListedSession, Redo, StrokeReport, Undo,
};
pub use manners::{
    ControlRequest, Denial, MAX_NAME, MAX_REASON, NO_REASON, Stop, StopClearing, StopRequest,
    check_name, check_reason,
};
pub use materials::{MaterialPreset, Materials};
pub use network::{Burst, Impairment, JitterDistribution, Network, Outage};
pub use operation::Operation;
pub use patch::{
    BurstPatch, ImpairmentPatch, MaterialPatch, NetworkPatch, OutagePatch, SessionPatch,
};
pub use problem::Problem;
pub use recording::{MAX_RATE_HZ, MAX_TOPICS, NewRecording, Recording, RecordingState};
pub use session::{
    ClayState, CorrectionsState, LoopState, MAX_TOOLS, NewSession, Quantiles, Session,
    SessionState, StorageReport, StorageState, TickQuantiles, ToolState,
};

pub use crate::{
    Axes, Material, MaterialChoice, NodeName, Preset, Scheme, SessionId, ToolDescription,
};
