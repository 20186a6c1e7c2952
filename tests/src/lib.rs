//! What tests of the whole need: real processes, an HTTP client, a watcher that can be slow, an impairing relay, and
//! readers of what the programs write.
//!
//! | module | holds |
//! |---|---|
//! | [`process`] | a process under test, its words, its end |
//! | [`stage`] | server, handle and relay as processes on ports of their own |
//! | [`demo`] | the whole of `cargo demo` but its build |
//! | [`client`] | the server's HTTP interface |
//! | [`watcher`] | a WebSocket that is read as slowly as one likes |
//! | [`recording`] | what a handle wrote down, tick by tick |
//! | [`relay`] | UDP through a bad network, seeded |
//! | [`namespaces`] | two hosts on one machine |
//! | [`inverse_service`] | a stand-in for the service of an Inverse3, with a hand at the arm |
//! | [`mesh`] | an STL file, and whether it is watertight |
//! | [`replay`] | such a recording swept through a block of its own |
//! | [`kills`] | a server that is killed again and again while hands cut |
//! | [`starved`] | whether a live test had the time that it needs, and what then |
//! | [`soak`] | a long run that watches its own memory |

pub mod client;
pub mod demo;
pub mod inverse_service;
pub mod kills;
pub mod mesh;
pub mod namespaces;
pub mod process;
pub mod recording;
pub mod relay;
pub mod replay;
pub mod soak;
pub mod stage;
pub mod starved;
pub mod watcher;
