//! The two sides of the bilateral loop as pure steps.
//!
//! | item | is |
//! |---|---|
//! | [`HandleSide`] | where the person is: reaction, limits, `C_h1`, device command |
//! | [`ToolSide`] | where the clay is: reference, motion limiter, `G_t^-1`, `G_t`, contact and cut |
//!
//! Every step is a function of (state, inputs, now): the same code runs on a thread at 1 kHz and on virtual time.

mod handle_side;
mod parameters;
mod tool_side;
mod tool_view;

pub use handle_side::{HandleSide, HandleStep, Lease, LinkState, Retired};
pub use parameters::{LoopModel, ParameterError, clay_shape, material, tool_setup, tool_shape};
pub use tool_side::{CUTS_A_TICK, Permission, ToolSide, ToolStep};
pub use tool_view::ToolView;
