//! How HTTP connections come in, and how they end, whatever is asked on them.
//!
//! | module | holds |
//! |---|---|
//! | `listener` | accepting, and a connection from its first byte to its last |
//! | `probe` | the question of whoever looks after a server |
//! | `security` | connections that are encrypted, and what they show of the server |
//! | `visitors` | who is connected: how many connections an address may hold |
//! | `tries` | how many wrong tokens an address may show |
//! | `stall` | connections whose other end has stopped reading |
//! | `linger` | connections that are closed so that the other end can read what was said last |

mod linger;
mod listener;
mod probe;
mod security;
mod stall;
mod tries;
mod visitors;

pub use listener::{Service, bind, serve};
pub use probe::check_health;
pub use security::{Security, SecurityError};
pub use tries::{ShownFor, Tries};
pub use visitors::Peer;
