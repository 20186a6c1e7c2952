//! Studies of what people tell apart: a file says what is shown to whom in which order, a machine gives the next trial
//! and takes an answer, and a threshold with its interval is fitted to the answers.
//!
//! | module | holds |
//! |---|---|
//! | [`file`] | the study file, read and checked |
//! | [`order`] | who meets which condition when, and the codes that stand for conditions |
//! | [`procedure`] | which level comes next: constant stimuli, a staircase, ratings |
//! | [`answer`] | what a participant answers, and how it is typed |
//! | [`run`] | one participant's way through the study |
//! | [`log`] | the file of answers, which is all the state that a run has |
//! | [`results`] | answers as tidy CSV, a row a trial, and back |
//! | [`psychometric`] | the share of right answers over the level |
//! | [`fit`] | the function that fits the answers best, and the interval of its threshold |
//! | [`observer`] | a simulated participant of known threshold |
//! | [`normal`] | the normal distribution |
//!
//! Chance is a seed, time is an argument: a run that was interrupted goes on where it was, from its answers alone.

pub mod answer;
mod chance;
pub mod file;
pub mod fit;
pub mod log;
pub mod normal;
pub mod observer;
pub mod order;
pub mod procedure;
pub mod psychometric;
pub mod results;
pub mod run;
