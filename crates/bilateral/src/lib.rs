//! The two sides of the bilateral loop as pure steps, the session that holds the clay, and the virtual-time rig that runs it all.
//!
//! | item | is |
//! |---|---|
//! | [`HandleSide`] | where the person is: reaction, limits, `C_h1`, device command |
//! | [`ToolSide`] | where the clay is: reference, motion limiter, `G_t^-1`, `G_t`, contact and cut |
//! | [`SessionLoop`] | one block of clay, its tools, and the line to each of them |
//! | [`rig`] | operator, handle side and session on virtual time |
//! | [`experiment`] | the cutting experiment of \[KHMH03\] Fig. 7 through the real clay |
//! | [`wall`] | the naive delayed wall, whose limit is known in closed form |
//!
//! Every step is a function of (state, inputs, now): the same code runs on a thread at 1 kHz and in the rig.

pub mod experiment;
mod handle_side;
mod parameters;
pub mod rig;
mod session;
mod tool_side;
mod tool_view;
pub mod wall;

pub use handle_side::{HandleSide, HandleStep, LinkState, Retired};
pub use parameters::{LoopModel, ParameterError, clay_shape, material, tool_setup, tool_shape};
pub use session::{FreshBlock, Lines, SessionLoop};
pub use tool_side::{Permission, ToolSide, ToolStep};
pub use tool_view::ToolView;
