//! The two sides of the bilateral loop as pure steps, and the session that holds the clay.
//!
//! | item | is |
//! |---|---|
//! | [`HandleSide`] | where the person is: reaction, limits, `C_h1`, device command |
//! | [`ToolSide`] | where the clay is: reference, motion limiter, `G_t^-1`, `G_t`, contact and cut |
//! | [`SessionLoop`] | one block of clay, its tools, and the line to each of them |
//!
//! Every step is a function of (state, inputs, now): the same code runs on a thread at 1 kHz and on virtual time.

mod handle_side;
mod parameters;
mod session;
mod tool_side;
mod tool_view;

pub use handle_side::{HandleSide, HandleStep, LinkState, Retired};
pub use parameters::{LoopModel, ParameterError, clay_shape, material, tool_setup, tool_shape};
pub use session::{FreshBlock, Lines, SessionLoop};
pub use tool_side::{Permission, ToolSide, ToolStep};
pub use tool_view::ToolView;
