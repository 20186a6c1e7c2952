//! The tool side's shell: the 1 kHz thread, Zenoh, sessions, HTTP and WebSocket.
//!
//! | module | holds |
//! |---|---|
//! | `engine` | the tick: all sessions as one machine, rings in and out |
//! | `collector` | what the tick leaves: answers, events, statistics, the watchers' clay, telemetry |
//! | [`doors`] | who is let in, and what the server shows of itself |
//! | [`directory`] | which sessions there are, and every way to change one |
//! | [`network`] | Zenoh: frames, joining, slow state |
//! | [`api`] | HTTP, WebSocket, OpenAPI, metrics, the dashboard |
//! | `ros` | what a session tells, in ROS 2's words |
//! | [`past`] | `teleclay-server history` |
//! | `placing` | on which thread a session lives, and whether there is time for it |
//! | `ros2` | sessions as ROS 2 is told of them |
//! | [`settings`] | defaults, file, environment, flags |

pub mod api;
mod collector;
pub mod directory;
pub mod doors;
mod engine;
pub mod network;
pub mod past;
mod placing;
mod ros;
mod ros2;
mod serve;
mod session;
pub mod settings;
mod state;
mod statistics;

pub use serve::{Server, run};
pub use session::{Event, Sample};
