//! Everything of teleclay that crosses a wire, as plain types and pure functions.
//!
//! | module | between | form |
//! |---|---|---|
//! | [`frame`] | handle side and tool side, 1 kHz, Zenoh | fixed binary layouts |
//! | [`keys`] | every Zenoh participant | key expressions |
//! | [`join`] | handle side and server, Zenoh queries | JSON |
//! | [`http`] | scripts, dashboard and server | JSON |
//! | [`watch`] | browsers and server over WebSocket; bricks over Zenoh too | binary and JSON text |
//!
//! The layouts are drawn in `proto/SPEC.md`; `proto/vectors/` holds messages that every language must decode and encode
//! to the same bytes. Units are SI and every quantity ends in its unit. Decoders never panic, whatever the bytes, and
//! the decoders of frames and of watch messages never allocate. They let non-finite floats through: the loop has one
//! place that checks its input, and a decoder that also did would be a second one to keep in step.

pub mod frame;
pub mod http;
pub mod invite;
pub mod join;
pub mod keys;
pub mod watch;

mod legible;
mod material;
mod names;
mod part;
mod scheme;
mod sequence;
mod tool;
mod validate;
mod word;

pub use material::{Material, MaterialChoice, Preset};
pub use names::{NameError, NodeName, RealmName, SessionId};
pub use part::Part;
pub use scheme::{Axes, AxesError, Scheme};
pub use sequence::is_after;
pub use teleclay_wire::FrameError;

pub use tool::ToolDescription;
pub use word::UnknownWord;

/// Version of the joining protocol, of the JSON types and of the WebSocket subprotocol (`teleclay.v1`).
///
/// Both ends must name the same one; there is no negotiation.
pub const PROTOCOL: u32 = 1;

/// The WebSocket subprotocol that a client must ask for.
pub const SUBPROTOCOL: &str = "teleclay.v1";
