//! Sessions on disk: what a server keeps of each while it runs, and what it begins with when it starts again.
//!
//! | module | holds |
//! |---|---|
//! | [`home`] | the folder of all sessions, and the lock that keeps other servers out |
//! | [`keeper`] | one session's history as its tick writes it |
//! | [`archive`] | the same as everybody else sees it: what is durable, how much it takes, snapshots |
//! | [`past`] | the state after what is on disk |

pub mod archive;
pub mod home;
pub mod keeper;
pub mod past;

pub use archive::{Archive, Storage};
pub use home::{Home, HomeError};
pub use keeper::Keeper;
pub use past::{PastError, state_of};
