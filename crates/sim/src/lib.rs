//! The loop on virtual time: a simulated person, both sides of the loop, a session and the lines between them, as fast
//! as the machine goes.
//!
//! | item | is |
//! |---|---|
//! | [`rig`] | operators, handle sides and a session in one thread |
//! | [`experiment`] | the cutting experiment of \[KHMH03\] Fig. 7 through the real clay |
//! | [`pointed`] | a pointer on a page that holds a tool of a session |
//! | [`wall`] | the naive delayed wall, whose limit is known in closed form |
//!
//! The same seed gives the same bits. The sides are the very ones that run on threads in the server and the handle.

pub mod experiment;
pub mod pointed;
pub mod rig;
pub mod wall;
