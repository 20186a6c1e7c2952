//! The Foxglove WebSocket protocol, as its server: messages as types, and a connection as one pure machine.
//!
//! Source: <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>. Text messages are JSON objects with a
//! field `op`; binary messages begin with a byte that says what they are, and are little-endian.
//!
//! | module | holds |
//! |---|---|
//! | [`client`] | what a client says |
//! | [`server`] | what a server says |
//! | [`connection`] | one client: what it is told there is, what it wants, what waits for it |
//!
//! A connection owns no socket and no clock. Nothing queues for a client without bound: of samples the newest wait,
//! state waits in front of them, and a client that does not take its state is to be closed.

mod bytes;
pub mod client;
pub mod connection;
pub mod server;

pub use connection::Connection;

/// The subprotocols that are this protocol: the name that Foxglove's SDK gives it, and the older one.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
