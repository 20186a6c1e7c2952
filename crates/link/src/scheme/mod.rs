//! The coupling of the two sides. One trait an end, one module a scheme.
//!
//! A scheme sees three-vectors at two ports. At the handle's port it turns what arrived into the *reaction*, the force the hand
//! feels, and the handle side makes of hand force plus reaction a position command through the shared admittance. At the tool's
//! port it turns what arrived into a *reference*, the place where the tool should be one tick later.
//!
//! Positions at both ports are displacements: the handle's from its home, the tool's from the point of the clay that the home maps
//! to. Signs are those of [KHMH03]: the clay's force on the tool opposes its motion, and the force ratio `A_h2` is negative, so the hand
//! feels `f_t / |A_h2|`.

mod force_exchange;

use teleclay_control::DiscreteStateSpace;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, ToolFrame};

use crate::Vec3;
use crate::time::Timestamp;

pub use force_exchange::{ForceExchangeHandle, ForceExchangeTool};

/// What is measured at the handle's port at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandlePort {
    /// Displacement from home, m.
    pub position: Vec3,
    /// Its rate, m/s.
    pub velocity: Vec3,
    /// Net hand force at the sensor, N.
    pub hand_force: Vec3,
}

/// What is measured at the tool's port at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolPort {
    /// Displacement from the image of the handle's home, m.
    pub position: Vec3,
    /// Its rate, m/s.
    pub velocity: Vec3,
    /// Force of the clay on the tool, N.
    pub clay_force: Vec3,
}

/// What both ends of every scheme know: the ratios, and the admittance `P = G_h C_h1` that the paper's scheme shares.
#[derive(Clone, Debug)]
pub struct Coupling {
    /// Tick, s.
    pub tick_s: f64,
    /// `A_h1`: tool displacement over handle displacement, above zero.
    pub position_ratio: f64,
    /// `A_h2`: clay force over hand force, below zero.
    pub force_ratio: f64,
    /// `C_h1` by Tustin, one for all axes.
    pub admittance: DiscreteStateSpace,
    /// `G_h` by zero-order hold, axis by axis.
    pub servo: [DiscreteStateSpace; 3],
}

impl Coupling {
    /// What the hand feels of a force of the clay on the tool, N.
    pub fn felt(&self, clay_force: Vec3) -> Vec3 {
        clay_force / -self.force_ratio
    }
}

/// A scheme's end at the handle.
pub trait HandleEnd: Send {
    /// A frame newer than all before it came.
    fn on_frame(&mut self, now: Timestamp, frame: &ToolFrame);

    /// The force on the hand for this tick, N, before limits and ramps.
    fn reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3;

    /// Writes what this scheme sends beyond pose and force.
    fn fill(&self, frame: &mut HandleFrame);
}

/// A scheme's end at the tool.
pub trait ToolEnd: Send {
    /// A frame newer than all before it came.
    fn on_frame(&mut self, now: Timestamp, frame: &HandleFrame);

    /// Where the tool should be one tick later, m. `remote_gain` is the watchdog's, 0 to 1; it scales whatever the scheme makes of
    /// old news.
    fn reference(&mut self, now: Timestamp, port: &ToolPort, remote_gain: f64) -> Vec3;

    /// Starts anew with the handle at `handle_position`, m, at rest.
    fn reindex(&mut self, handle_position: Vec3);

    /// How the tool gets back to the reference after it was held.
    fn recovery(&self) -> Recovery;

    /// Writes what this scheme sends beyond pose and force.
    fn fill(&self, frame: &mut ToolFrame);
}

/// What a reference means after a pause or a silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recovery {
    /// It is where the handle is: the tool goes there, slowly.
    Absolute,
    /// It is a sum of increments: where it stands is as good as anywhere, so the tool goes on from where it was held.
    Incremental,
}

/// Why a scheme cannot be had here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("scheme {scheme} is not available, have force_exchange")]
pub struct SchemeUnavailable {
    /// As asked for.
    pub scheme: Scheme,
}

/// Whether a scheme can be had.
///
/// # Errors
/// The scheme is not available.
pub fn availability(scheme: Scheme) -> Result<(), SchemeUnavailable> {
    match scheme {
        Scheme::ForceExchange => Ok(()),
        _ => Err(SchemeUnavailable { scheme }),
    }
}

/// The handle's end of a scheme, at rest.
///
/// # Errors
/// The scheme is not available.
pub fn handle_end(
    scheme: Scheme,
    coupling: &Coupling,
) -> Result<Box<dyn HandleEnd>, SchemeUnavailable> {
    match scheme {
        Scheme::ForceExchange => Ok(Box::new(ForceExchangeHandle::new(coupling.clone()))),
        _ => Err(SchemeUnavailable { scheme }),
    }
}

/// The tool's end of a scheme, at rest with the handle at home.
///
/// # Errors
/// The scheme is not available.
pub fn tool_end(
    scheme: Scheme,
    coupling: &Coupling,
) -> Result<Box<dyn ToolEnd>, SchemeUnavailable> {
    match scheme {
        Scheme::ForceExchange => Ok(Box::new(ForceExchangeTool::new(coupling.clone()))),
        _ => Err(SchemeUnavailable { scheme }),
    }
}
