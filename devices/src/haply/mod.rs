//! The Inverse3 of Haply Robotics, over the Haply Inverse Service on this machine.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the service's messages, as far as they are needed |
//! | [`machine`] | the protocol: messages and times in, messages out; no socket |
//! | [`taking`] | how a hand takes hold: a button of the grip, or rest at home |
//! | [`socket`] | the two WebSockets, and the driver on them |
//!
//! The simulation channel (port 10001) sends an inventory once, and from then on one state for each message that it
//! gets; who stops sending hears nothing more. The event channel (port 10020) tells of brakes and plugs. Messages are
//! those of the service's public pages, version 3.5; the older spelling of a force (`values` for `vector`) is spoken to
//! a service whose inventory is of the older kind.
//!
//! Before a force reaches the motors, the service damps oscillations, may weaken it (*force gate*), adds its own
//! damping and multiplies it by a scale of its own. The inventory tells of gate and damping, and they are passed on
//! ([`machine::Law`]); the scale is one of its settings and told nowhere, so that with a scale above 1 the device
//! renders more than it was told here.

pub mod machine;
pub mod message;
pub mod socket;
pub mod taking;

pub use machine::{End, Law, Machine};
pub use socket::{HaplyDriver, ServiceAddress};
