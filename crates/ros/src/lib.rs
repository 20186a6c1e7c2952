//! What teleclay says in ROS 2's words: messages and services as bytes, as texts and as hashes. Pure functions; nothing
//! here knows a network or a file.
//!
//! | module | has |
//! |---|---|
//! | `cdr` | the bytes of a message: classic CDR, little-endian, as every ROS 2 middleware and MCAP's `cdr` have it |
//! | `message` | what a message is, and how one is made of its fields |
//! | [`standard`] | the messages of ROS 2 that are used |
//! | [`own`] | those of the package `teleclay_msgs`, whose texts lie in `ros2/teleclay_msgs` |
//! | `interface` | the texts of all of them, MCAP's `ros2msg` |
//! | `type_hash` | RIHS01, by which two ends of a topic know that they mean the same type |
//! | [`names`] | topics, services and frames of a session |
//! | [`SessionClock`] | when a sample of a session was, by everybody's clock |
//!
//! ```
//! use teleclay_ros::{standard::Vector3, to_cdr};
//!
//! let mut bytes = Vec::new();
//! to_cdr(&Vector3 { x: 1.0, y: 0.0, z: 0.0 }, &mut bytes);
//! // Four bytes that say how the rest is written, then three doubles.
//! assert_eq!(bytes.len(), 4 + 3 * 8);
//! assert_eq!(bytes[..12], [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
//! ```

mod cdr;
mod clock;
mod interface;
mod message;
pub mod names;
pub mod own;
pub mod standard;
mod type_hash;

pub use cdr::{Cdr, CdrError, CdrReader};
pub use clock::SessionClock;
pub use interface::{definition, names as interfaces};
pub use message::{FromCdr, Message, from_cdr, to_cdr};
pub use type_hash::type_hash;
