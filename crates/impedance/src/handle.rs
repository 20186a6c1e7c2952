//! Coupling and handle in one: to the loop it is a device like any other.

use teleclay_device::{DeviceCommand, DeviceSample};

use crate::coupling::{Coupling, CouplingStep, HandlePlace};
use crate::setup::{CouplingSetup, SetupError};

/// A handle without a mass of its own, held through a [`Coupling`]. It follows its command exactly, one tick later.
///
/// ```text
/// each tick:   coupling().sample(..) for what came   ->   sample(now)   ->   HandleSide::step   ->   command(..)
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ImpedanceHandle {
    coupling: Coupling,
    place: HandlePlace,
    last: Option<CouplingStep>,
}

impl ImpedanceHandle {
    /// At home, at rest, released.
    ///
    /// # Errors
    /// As [`Coupling::new`].
    pub fn new(setup: CouplingSetup) -> Result<Self, SetupError> {
        Ok(Self {
            coupling: Coupling::new(setup)?,
            place: HandlePlace::default(),
            last: None,
        })
    }

    /// The coupling: what samples come to, and who holds it.
    pub fn coupling(&mut self) -> &mut Coupling {
        &mut self.coupling
    }

    /// What this handle's sensors read at `now_ns`: the tick's step of the coupling. Where the handle has a lift, the
    /// device sets it.
    pub fn sample(&mut self, now_ns: u64) -> DeviceSample {
        let step = self.coupling.step(now_ns, &self.place);
        if self.coupling.setup().axes == 2 {
            self.place.position_m[2] = step.target_m[2];
        }
        self.last = Some(step);
        DeviceSample {
            position_m: self.place.position_m,
            velocity_m_s: self.place.velocity_m_s,
            hand_force_n: step.hand_force_n,
        }
    }

    /// Where the handle goes in the tick that begins now. Returns what the device renders meanwhile, N: the coupling's
    /// force, not the command's, which the hand feels through the coupling. A place that is none is not gone to.
    pub fn command(&mut self, command: &DeviceCommand) -> [f64; 3] {
        let tick_s = self.coupling.setup().handle.tick_s;
        for axis in 0..self.coupling.setup().axes {
            let to_m = command.position_m[axis];
            let way_m = if to_m.is_finite() {
                to_m - self.place.position_m[axis]
            } else {
                0.0
            };
            self.place.velocity_m_s[axis] = way_m / tick_s;
            self.place.position_m[axis] += way_m;
        }
        self.last.map_or([0.0; 3], |step| step.device_force_n)
    }

    /// Where the handle is.
    pub fn place(&self) -> HandlePlace {
        self.place
    }

    /// What the coupling gave at the last [`sample`](Self::sample).
    pub fn last(&self) -> Option<CouplingStep> {
        self.last
    }
}
