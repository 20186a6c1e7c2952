//! The coupling of the two sides. One trait for each end, one module for each scheme.
//!
//! A scheme sees three-vectors at two ports. At the handle's port it turns what arrived into the *reaction*, the force
//! the hand feels, and the handle side makes of hand force plus reaction a position command through the shared
//! admittance. At the tool's port it turns what arrived into a *reference*, the place where the tool should be one tick
//! later.
//!
//! Positions at both ports are displacements: the handle's from its home, the tool's from the point of the clay that
//! the home maps to. Signs are those of [KHMH03]: the clay's force on the tool opposes its motion, and the force ratio
//! `A_h2` is negative, so the hand feels `f_t / |A_h2|`.
//!
//! | scheme | goes up | comes down | under delay |
//! |---|---|---|---|
//! | [`force_exchange`] | hand force | clay force | mostly stable, hand and tool drift apart |
//! | [`position_force`] | position | clay force | unstable beyond a margin |
//! | [`wave`] | wave | wave | passive, softer by `D / b` |
//! | [`tdpa`] | velocity, position, energy | clay force, energy | passive, damps what it cannot afford |
//! | [`replica`] | cuts | what became of them, others' cuts | not felt; the server's clay follows a delay later |
//!
//! For passivity every port tells true work: how far it moved over a tick, and the force that was really applied
//! meanwhile, after all limits and ramps. A scheme that reckons with what it asked for would be passive on paper only.

pub mod force_exchange;
mod play_head;
pub mod position_force;
pub mod replica;
pub mod tdpa;
pub mod wave;

use std::sync::Arc;
use std::time::Duration;

use teleclay_clay::Clay;
use teleclay_control::DiscreteStateSpace;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, HandleFrame, ToolFrame};

use crate::Vec3;
use crate::time::Timestamp;

use crate::deadband::Signal;
use crate::motion_limiter::Recovery;
use crate::replica::{Copy, Cut, SweepLog, ToolSetup};
use force_exchange::{ForceExchangeHandle, ForceExchangeTool};
use position_force::{PositionForceHandle, PositionForceTool};
use replica::{MergeContext, Merged, ReplicaHandle, ReplicaTool, Snapshot, WantedSnapshot};
use tdpa::{TdpaHandle, TdpaTool};
use wave::{WaveHandle, WaveTool};

/// What is measured at the handle's port at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandlePort {
    /// Displacement from home, m.
    pub position: Vec3,
    /// Its rate, m/s.
    pub velocity: Vec3,
    /// Net hand force at the sensor, N.
    pub hand_force: Vec3,
    /// How far it moved since the last tick, m; zero on axes that reflect no force.
    pub displacement: Vec3,
    /// What the hand felt meanwhile, N, after all limits.
    pub felt_force: Vec3,
}

/// What is measured at the tool's port at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolPort {
    /// Displacement from the image of the handle's home, m.
    pub position: Vec3,
    /// Its rate, m/s.
    pub velocity: Vec3,
    /// Force of the clay on the tool, N: its answer to the last displacement. Zero on axes that reflect no force.
    pub clay_force: Vec3,
    /// The part of it that is the clay's spring, N, and so does not depend on the speed.
    pub spring_force: Vec3,
    /// How far the tool moved in the last tick, m; zero on axes that reflect no force.
    pub displacement: Vec3,
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
    /// `M_t`: mass that the tool has where a scheme lets it move by force, kg.
    pub tool_mass_kg: f64,
    /// `b` of the wave scheme, N s/m, above zero.
    pub wave_impedance_n_s_per_m: f64,
}

impl Coupling {
    /// What the hand feels of a force of the clay on the tool, N.
    pub fn felt(&self, clay_force: Vec3) -> Vec3 {
        clay_force / -self.force_ratio
    }

    /// Clay's joules for one of the handle's, `A_h1 |A_h2|`.
    pub fn power_ratio(&self) -> f64 {
        self.position_ratio * -self.force_ratio
    }

    /// The tool's mass as the handle's port sees it, kg.
    pub fn felt_mass_kg(&self) -> f64 {
        self.tool_mass_kg * self.position_ratio / -self.force_ratio
    }
}

/// From when on frames are meant for a scheme's controller, and which clay they cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Generation {
    /// Revision of the session from which on frames are of this generation.
    pub since_revision: u32,
    /// The block of clay: sweeps of another one cut clay that is gone.
    pub epoch: u32,
}

/// A scheme's controller at the handle.
pub trait HandleController: Send {
    /// A frame newer than all before it came.
    fn on_frame(&mut self, now: Timestamp, frame: &ToolFrame);

    /// A frame came after a newer one, or came again. Only a scheme that plays samples in their order wants it.
    fn on_late_frame(&mut self, _now: Timestamp, _frame: &ToolFrame) {}

    /// A frame came that had waited in a queue, see [`freshness`](crate::freshness). Only the facts in it count: cuts,
    /// and what became of cuts.
    fn on_stale_frame(&mut self, _now: Timestamp, _frame: &ToolFrame) {}

    /// Frames are news again after some that had waited. Nothing is owed for what those said.
    fn on_news_again(&mut self) {}

    /// Another tool side is at the far end from now on, under another server or another lease. It knows nothing of what
    /// came to the one before, and what it has to tell it numbers anew.
    fn on_another_peer(&mut self) {}

    /// The force on the hand for this tick, N, before limits and ramps.
    fn reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3;

    /// Whether what is felt comes from frames, so that the watchdog must take it away when they stop.
    fn needs_frames(&self) -> bool {
        true
    }

    /// Writes what this scheme sends beyond pose and force.
    fn fill(&mut self, frame: &mut HandleFrame);

    /// What of this frame the other end works with, for a deadband; `None` where it needs every tick.
    fn signal(&self, frame: &HandleFrame) -> Option<Signal>;

    /// Whether the frame has to go out whatever the deadband says.
    fn has_urgent_news(&self) -> bool {
        false
    }

    /// The frame went out, just as it was filled last.
    fn on_sent(&mut self, _frame: &HandleFrame) {}

    /// The copy of the clay that is felt here, where the scheme keeps one.
    fn clay_copy(&self) -> Option<&dyn ClayCopy> {
        None
    }

    /// Likewise, to give it a snapshot.
    fn clay_copy_mut(&mut self) -> Option<&mut dyn ClayCopy> {
        None
    }
}

/// What a scheme can do that keeps a copy of the clay at the handle's side.
pub trait ClayCopy {
    /// What the copy is good for.
    fn state(&self) -> CopyState;

    /// The copy, once a snapshot has come.
    fn copy(&self) -> Option<&Copy>;

    /// The sweeps made here.
    fn log(&self) -> &SweepLog;

    /// The snapshot that the shell should ask the server for, until it has come. A new number is a new request.
    fn wanted_snapshot(&self) -> Option<WantedSnapshot>;

    /// A snapshot came. What it replaces, or the snapshot itself if it shows another block, waits to be dropped
    /// elsewhere, see [`ClayCopy::poll_retired`].
    fn handle_snapshot(&mut self, snapshot: Snapshot);

    /// Another tool, another place, or other clay, from now on.
    fn move_to(&mut self, setup: &Arc<ToolSetup>);

    /// Clay that is not needed any more, to be dropped where that costs nobody a tick.
    fn poll_retired(&mut self) -> Option<Box<Clay>>;
}

/// A scheme's controller at the tool.
pub trait ToolController: Send {
    /// Frames of this generation and later ones are meant for this controller.
    fn begin(&mut self, _generation: Generation) {}

    /// Whether everything that the handle is known to have cut has been merged.
    fn has_merged_all(&self) -> bool {
        true
    }

    /// A frame newer than all before it came.
    fn on_frame(&mut self, now: Timestamp, frame: &HandleFrame);

    /// A frame came after a newer one, or came again. Only a scheme that plays samples in their order wants it.
    fn on_late_frame(&mut self, _now: Timestamp, _frame: &HandleFrame) {}

    /// A frame came that had waited in a queue, see [`freshness`](crate::freshness). Only the facts in it count: cuts,
    /// and what became of cuts.
    fn on_stale_frame(&mut self, _now: Timestamp, _frame: &HandleFrame) {}

    /// Frames are news again after some that had waited. Nothing is owed for what those said.
    fn on_news_again(&mut self) {}

    /// One tick of a tool that the handle's sweeps lead. `None` where they do not: then the tool follows
    /// [`ToolController::reference`].
    fn merge(
        &mut self,
        _now: Timestamp,
        _port: &ToolPort,
        _context: MergeContext<'_>,
    ) -> Option<Merged> {
        None
    }

    /// From now on the handle is told to leave frames out, for so long at most; `None`: to send one every tick.
    /// `velocity` is the handle's as last received, m/s.
    fn expect_gaps(&mut self, _longest: Option<Duration>, _velocity: Vec3) {}

    /// Where the tool should be one tick later, m. `remote_gain` is the watchdog's, 0 to 1; it scales whatever the
    /// scheme makes of old news.
    fn reference(&mut self, now: Timestamp, port: &ToolPort, remote_gain: f64) -> Vec3;

    /// The tool has moved, perhaps otherwise than the reference asked, and the clay has answered.
    fn moved(&mut self, _port: &ToolPort) {}

    /// Starts anew with the handle at `handle_position`, m, at rest.
    fn reindex(&mut self, handle_position: Vec3);

    /// How the tool gets back to the reference after it was held.
    fn recovery(&self) -> Recovery;

    /// The clay was exchanged for a fresh block; `reindex` follows.
    fn on_fresh_block(&mut self, _epoch: u32) {}

    /// The clay was exchanged for another one in the same place: sweeps that are on their way count.
    fn on_exchanged_clay(&mut self, _epoch: u32) {}

    /// Goes on where the controller of an earlier server has ended: every sweep up to `decided` was merged or refused.
    fn resume(&mut self, _decided: u32) {}

    /// Every sweep up to this number has been merged or refused; 0 where there are none.
    fn sweeps_decided(&self) -> u32 {
        0
    }

    /// The tool works elsewhere from now on.
    fn move_to(&mut self, _setup: &Arc<ToolSetup>) {}

    /// Another tool has cut the clay.
    fn relay(&mut self, _cut: Cut) {}

    /// Writes what this scheme sends beyond pose and force.
    fn fill(&mut self, frame: &mut ToolFrame);

    /// What of this frame the other end works with, for a deadband; `None` where it needs every tick.
    fn signal(&self, frame: &ToolFrame) -> Option<Signal>;

    /// Whether the frame has to go out whatever the deadband says.
    fn has_urgent_news(&self) -> bool {
        false
    }

    /// The frame went out, just as it was filled last.
    fn on_sent(&mut self, _frame: &ToolFrame) {}
}

/// What a session's schemes are made from.
#[derive(Clone, Debug)]
pub struct SchemeContext {
    /// Ratios and plants.
    pub coupling: Coupling,
    /// Tool, clay and bounds, for schemes that work them at both ends.
    pub setup: Arc<ToolSetup>,
}

/// Makes the controllers of a scheme: of one that sessions have, [`Scheme`], or of one that is defined elsewhere. What
/// the controllers must keep to stands in docs/schemes.md.
pub trait Controllers: Send + Sync {
    /// The handle's controller, at rest.
    fn handle(&self, context: &SchemeContext) -> Box<dyn HandleController>;

    /// The tool's controller, at rest with the handle at home.
    fn tool(&self, context: &SchemeContext) -> Box<dyn ToolController>;
}

impl Controllers for Scheme {
    fn handle(&self, context: &SchemeContext) -> Box<dyn HandleController> {
        handle_controller(*self, context)
    }

    fn tool(&self, context: &SchemeContext) -> Box<dyn ToolController> {
        tool_controller(*self, context)
    }
}

impl<C: Controllers + ?Sized> Controllers for &C {
    fn handle(&self, context: &SchemeContext) -> Box<dyn HandleController> {
        (**self).handle(context)
    }

    fn tool(&self, context: &SchemeContext) -> Box<dyn ToolController> {
        (**self).tool(context)
    }
}

/// The handle's controller of a scheme, at rest.
pub fn handle_controller(scheme: Scheme, context: &SchemeContext) -> Box<dyn HandleController> {
    let coupling = context.coupling.clone();
    match scheme {
        Scheme::ForceExchange => Box::new(ForceExchangeHandle::new(coupling)),
        Scheme::PositionForce => Box::new(PositionForceHandle::new(coupling)),
        Scheme::Wave => Box::new(WaveHandle::new(&coupling)),
        Scheme::Tdpa => Box::new(TdpaHandle::new(coupling)),
        Scheme::Replica => Box::new(ReplicaHandle::new(coupling, Arc::clone(&context.setup))),
    }
}

/// The tool's controller of a scheme, at rest with the handle at home. Which frames are meant for it
/// [`ToolController::begin`] says.
pub fn tool_controller(scheme: Scheme, context: &SchemeContext) -> Box<dyn ToolController> {
    let coupling = context.coupling.clone();
    match scheme {
        Scheme::ForceExchange => Box::new(ForceExchangeTool::new(coupling)),
        Scheme::PositionForce => Box::new(PositionForceTool::new(&coupling)),
        Scheme::Wave => Box::new(WaveTool::new(coupling)),
        Scheme::Tdpa => Box::new(TdpaTool::new(coupling)),
        Scheme::Replica => Box::new(ReplicaTool::new(coupling, Arc::clone(&context.setup))),
    }
}

/// How steeply what the clay answered at this port rises with speed, N s/m at the handle's port. Exact for viscous
/// clay; zero where the clay does not take energy.
///
/// The spring's part is left out: over a speed near zero it would pass for a damper without bounds, and hold the tool
/// fast a little off the place where the forces balance until the last of the speed is gone, and let it jump then.
pub(crate) fn resistance_slope(coupling: &Coupling, port: &ToolPort) -> f64 {
    let velocity = port.velocity / coupling.position_ratio;
    let flow = coupling.felt(port.spring_force - port.clay_force);
    let speed_squared = velocity.norm_squared();
    if speed_squared < 1e-18 {
        return 0.0;
    }
    (flow.dot(&velocity) / speed_squared).max(0.0)
}
