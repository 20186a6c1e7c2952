//! The two sides of the bilateral loop as pure steps.
//!
//! | item | is |
//! |---|---|
//! | [`HandleSide`] | where the person is: reaction, limits, `C_h1`, device command |
//! | [`ReceivedClay`] | the server's clay, brick by brick, for a handle's copy |
//! | [`lower`], [`is_device_tick`], [`Known`] | what of a grant a handle takes, and whether it goes on under it |
//! | [`ToolSide`] | where the clay is: reference, motion limiter, `G_t^-1`, `G_t`, contact and cut |
//!
//! Every step is a function of (state, inputs, now): the same code runs on a thread at 1 kHz and on virtual time.

mod granted;
mod handle_side;
mod known;
mod parameters;
mod received;
mod tool_side;
mod tool_view;

pub use granted::{is_device_tick, lower};
pub use handle_side::{HandleSide, HandleStep, Lease, LinkState, Retired};
pub use known::{Known, is_nothing_new, is_same_loop};
pub use parameters::{
    FreshClayError, LoopModel, ParameterError, clay_shape, fresh_clay, material, operation,
    tool_setup, tool_shape,
};
pub use received::{NotReceived, ReceivedClay};
pub use tool_side::{CUTS_A_TICK, Permission, ToolSide, ToolStep};
pub use tool_view::ToolView;
