//! Who may come in, and how they know whom they came to: what a server keeps of that in its data folder, under
//! `doors/`.
//!
//! | module | keeps |
//! |---|---|
//! | [`authority`] | a private certificate authority, and the certificates that it issues: `authority.pem`, `authority.key` |
//! | [`invites`] | who was invited, to what, until when: `invites.json` |
//! | [`audit`] | who did what to which session: `audit.jsonl` |
//!
//! Every file is readable by its owner alone.

pub mod audit;
pub mod authority;
mod files;
pub mod invites;

pub use authority::{Authority, Identity};
pub use files::DoorError;
pub use invites::{Guest, Invite, Invites};
