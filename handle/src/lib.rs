//! The handle side's shell: a haptic device, the handle side of the loop on a 1 kHz thread, and Zenoh.
//!
//! | module | holds |
//! |---|---|
//! | [`device`] | what a device must do; the simulated ones, and those that a hand holds, by `teleclay-devices` |
//! | [`door`] | the way to the server, and the certificate that it must show |
//! | [`intent`] | what the simulated operator is to do |
//! | [`arguments`] | the command line |
//! | [`mod@run`] | join, drive the device, notice what is lost, join again, leave |
//! | [`event`], [`status`] | what it tells on the way |
//! | [`recording`] | every tick in a file |
//!
//! Within, `engine` is the tick; `attachment` is one lease as the tick holds it, and `line` the network's end of the
//! same lease; `outbox` carries frames from the one to the other; `join` asks the server, `grant` is its yes, and
//! `question` what is asked under it; `singularity` tells when a robot comes near one.
//!
//! `refresh` fetches what the loop wants to know while it runs: changed parameters, and snapshots of the clay for the
//! replica.
//!
//! What follows from a silent server: within the allowed silence plus the ramp (0.15 s by default) the remote part of
//! the force is zero, in the handle side itself. After a second of silence the server is asked for another lease, until
//! there is one again. Under a lease of the same session and tool, from a server that has gone on or has recovered the
//! session, the handle side goes on: only the line is exchanged, what the server lacks of the cuts goes out again, and
//! the force returns by the ramp. Under any other lease the handle first comes to rest, and a new loop starts from
//! where it stands, at zero force; so it does after a lease that the server itself has ended. A copy of the clay needs
//! no frames: there the force goes on, cutting ends after two seconds, the force within another, and another lease is
//! asked for after eight: the silence is what counts, not the lease. A server whose process ends is seen to go, and the
//! force goes after 0.05 s of silence, copy or not.

pub mod arguments;
pub mod device;
pub mod door;
pub mod event;
pub mod intent;
pub mod recording;
mod refresh;
pub mod run;
pub mod status;

mod attachment;
mod engine;
mod grant;
mod join;
mod line;
mod outbox;
mod question;
mod singularity;

pub use join::JoinError;
pub use line::LineError;
pub use run::run;
