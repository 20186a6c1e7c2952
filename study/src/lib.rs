//! `teleclay-study`: checks a study's file, runs it with a participant at a session, simulates it, fits its results.
//!
//! | module | holds |
//! |---|---|
//! | [`commands`] | what each command does |
//! | [`conduct`] | a participant's run: what is shown, asked and kept |
//! | [`answers`] | the file of answers, which outlives the process |
//! | [`session`] | the session that trials are shown in, over HTTP |
//! | [`table`] | thresholds as CSV |

pub mod answers;
pub mod commands;
pub mod conduct;
pub mod session;
pub mod table;
