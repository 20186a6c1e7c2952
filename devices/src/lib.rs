//! Drivers of devices that a hand holds: gamepad, joystick, Haply Inverse3.
//!
//! Each driver has a thread of its own that talks to the hardware. It and the 1 kHz tick exchange news and forces over
//! rings of fixed length: the tick neither waits nor allocates. What the tick holds is [`Coupled`], the virtual
//! coupling of `teleclay-impedance` with the tick's ends of the rings.
//!
//! ```text
//!   hardware <──> Driver::step ──News──> ring ──> Coupled::sample  ──> handle side
//!                  own thread  <──Order── ring <── Coupled::command <──
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`profile`] | what each device is, may do to a hand, and how stiff its coupling is |
//! | [`coupled`] | the device as the tick holds it |
//! | [`exchange`], [`thread`] | the two rings, the ends of them, and the thread |
//! | [`gap`] | sleep and stalls: after either, nothing resumes by itself |
//! | [`pad`] | gamepad and joystick over Linux's evdev |
//! | [`haply`] | the Inverse3 over the Haply Inverse Service |
//! | [`fault`] | why a device cannot be used, each with where it was looked for and what to do |
//!
//! None of these drivers was tried on hardware: each is tested against a stand-in.
//!
//! Gamepads are read with the `evdev` crate and not with `gilrs`, whose core links the system's libudev on Linux and
//! needs pkg-config and its headers to build, without an option to do without.

pub mod coupled;
pub mod exchange;
pub mod fault;
pub mod gap;
pub mod haply;
pub mod pad;
pub mod profile;
pub mod thread;

pub use coupled::Coupled;
pub use fault::DeviceFault;
pub use profile::{Hardware, SessionNeeds};
