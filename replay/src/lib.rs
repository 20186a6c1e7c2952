//! What a recording tells, once more: through the same loop, where it must come out, or through another one.
//!
//! | module | holds |
//! |---|---|
//! | [`again`] | the tool side of a session, told by its recording |
//! | [`verify`] | whether clay and cuts come out bit for bit |
//! | [`felt`] | the recorded hand under another scheme or over another line |
//! | [`moment`] | a moment of it, in numbers |
//! | [`studio`] | a recording of what a rig does on virtual time |

pub mod again;
pub mod felt;
pub mod moment;
pub mod studio;
pub mod verify;

pub use felt::{Felt, FeltError, Question};
pub use studio::Studio;
pub use verify::{Verdict, VerifyError, verify};
