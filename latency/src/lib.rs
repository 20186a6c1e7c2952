//! What delay does to the hand and to the clay: the same task under every scheme over every line, on virtual time, from
//! seeds.
//!
//! | module | holds |
//! |---|---|
//! | [`law`] | what couples hand and tool: a scheme of a session, or one of somebody's own |
//! | [`cell`] | what is varied: scheme, delay, jitter, loss, and the special lines |
//! | [`task`] | what the operator does, and the rig it is done on |
//! | [`run`] | one run of one cell, measured against the run without a network |
//! | [`table`] | many seeds of many cells, as rows |
//! | [`wall`] | the stiffness at which the naive wall turns unstable, measured and by theory |
//! | [`report`] | the rows as Markdown and as pictures |
//! | [`program`] | the command line |

pub mod cell;
pub mod law;
pub mod program;
pub mod report;
pub mod run;
pub mod table;
pub mod task;
pub mod wall;
