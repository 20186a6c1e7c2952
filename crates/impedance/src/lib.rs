//! A handle for every device that cannot be commanded in position: a mouse, a finger on glass, a stick, a device that
//! only pushes.
//!
//! Such a device is an impedance: it is moved, and at most pushes back. The loop's handle is an admittance: it takes
//! the hand's force and says where it is. Between the two stands a virtual coupling, a spring and a damper:
//!
//! ```text
//!   device's place ──> Reading ──> Grasp ──x_d──┐
//!                                               ├─> f_h = K (x_d - y_h) + B (v_d - v_h) ──> cap, slew ──> HandleSide
//!   loop's handle  ──────────────────────y_h────┘                                              └──> -f_h on the device
//! ```
//!
//! | item | is |
//! |---|---|
//! | [`ImpedanceHandle`] | coupling and handle in one: sampled and commanded each tick, as any device of the loop |
//! | [`Coupling`] | the spring and the damper, and who holds them: hold, release, clutch, scale, locks |
//! | [`CouplingSetup`], [`SetupError`] | what it is made of, and why it cannot be |
//! | [`Scale`] | how motion and force are scaled between device and handle |
//! | [`max_stiffness`], [`DeviceTiming`], [`LoopHandle`] | the stiffest spring that stays passive, and why |
//! | [`Reading`], [`Playback`] | the device's place at every tick, from samples that come when they come |
//! | [`Observer`] | the energy that a coupling has taken, less what it has given |
//!
//! SI units throughout. Time is an argument, in nanoseconds of the caller's own clock. Nothing here allocates once it
//! is made; only additions, multiplications, divisions and roots are used, which every machine rounds alike.

mod coupling;
mod grasp;
mod handle;
mod observer;
mod reading;
mod scale;
mod setup;
mod stiffness;
mod vector;

pub use coupling::{Coupling, CouplingStep, HandlePlace};
pub use grasp::GraspState;
pub use handle::ImpedanceHandle;
pub use observer::Observer;
pub use reading::{Playback, Played, Reading, Taken};
pub use scale::{MOTION_RANGE, Scale};
pub use setup::{CouplingSetup, SetupError};
pub use stiffness::{DeviceTiming, LoopHandle, TimingError, max_stiffness, series};
