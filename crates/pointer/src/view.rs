//! What there is to draw, to count, and to ask for.

use teleclay_bilateral::LinkState;
use teleclay_impedance::GraspState;
use teleclay_link::scheme::replica::WantedSnapshot;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, Corrections};

/// Who moves the handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The loop.
    Coupled,
    /// The brake, on its way to rest.
    Braking,
    /// Nobody: the handle is at rest and stays there.
    Resting,
}

/// What was counted since the machine was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Ticks that were made.
    pub ticks: u64,
    /// Ticks that were given up.
    pub given_up: u64,
    /// Gaps so long that whoever held the handle has to take hold anew.
    pub gaps: u64,
    /// Ticks in which the device's own law changed what the loop commanded.
    pub guarded: u64,
    /// Frames that went out.
    pub sent: u64,
    /// Frames that were made too late to be news, and did not.
    pub stale: u64,
    /// What the server did not write, or wrote before.
    pub unheard: u64,
    /// Messages and frames that are none.
    pub undecodable: u64,
    /// Frames under another lease.
    pub foreign: u64,
    /// Frames and samples that found no room.
    pub overflowed: u64,
}

/// The state of the last tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Its time, ns.
    pub at_ns: u64,
    /// Who moves the handle.
    pub mode: Mode,
    /// Whether the far side is felt, and if not, why.
    pub link_state: LinkState,
    /// Who holds the handle.
    pub grasp: GraspState,
    /// The scheme in force.
    pub scheme: Scheme,
    /// What the copy of the clay is good for.
    pub copy: CopyState,
    /// Where the pointer draws the handle to, displacement from home, m.
    pub hand_m: [f64; 3],
    /// Where the handle is, m.
    pub handle_m: [f64; 3],
    /// Where the tool is in the clay's frame, m: in the copy, or as last heard.
    pub tool_m: [f64; 3],
    /// Force of the far side on the handle after every limit, N.
    pub felt_force_n: [f64; 3],
    /// Force of the hand on the handle, through the coupling, N.
    pub hand_force_n: [f64; 3],
    /// What the device renders, N.
    pub device_force_n: [f64; 3],
    /// Hash of the copy's clay, where it is known.
    pub clay_hash: Option<u64>,
    /// Which block it is.
    pub clay_epoch: u32,
    /// Round trip as last seen, s.
    pub round_trip_s: Option<f64>,
    /// Time without a frame, s.
    pub silence_s: f64,
    /// What corrections of the copy have done to the hand.
    pub corrections: Corrections,
    /// Whether the loop ended in a fault.
    pub is_in_fault: bool,
}

/// What the server is to be asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Parameters: the session has come to another revision.
    pub parameters: bool,
    /// The clay, for the copy.
    pub snapshot: Option<WantedSnapshot>,
    /// Another lease: this one is silent, or over.
    pub lease: bool,
}
