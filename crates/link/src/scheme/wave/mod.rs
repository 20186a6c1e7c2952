//! Wave variables: what travels is neither force nor velocity but a mix of both that no delay can make active. Source:
//! [NS91] in docs/papers.md.
//!
//! ```text
//! s = sqrt(2 b)          F v = (u² - w²) / 2          u up, w down, F resists the hand, felt = -F
//!
//! handle   F = b v - s w              u = s v - w
//! tool     F = s u - b v              w = s v - u                  (w = u - (2 / s) F, the same)
//! ```
//!
//! `v` and `F` at both ends are those of the handle's port: the tool's are divided by `A_h1` and `|A_h2|`.
//!
//! # The tool
//!
//! Ours follows places, not forces. So the controller gives it a mass, that of the tool, which wave and clay drive:
//!
//! ```text
//! m (v' - v) / T = s u - b v' - F_e - B (v' - v)          reference += A_h1 T v'
//! ```
//!
//! with the clay's last resistance `F_e` and its slope `B`: implicit in the viscous part, so that no clay is too thick
//! for the tick.
//!
//! # Energy in samples
//!
//! The identity above holds at an instant. What is true over a tick is `F d` with the displacement `d`, and `d / T` is
//! not the `v` that made `F`; limits, ramps and the motion limiter change force and motion further. So `w` and `u` are
//! formed *after* the tick, from what really happened, with `v = d / T`, and each port keeps an account: energy of the
//! waves that came, plus true work, less energy of the waves that went. Where the account does not cover the wave that
//! the identity asks for, a shorter one goes out, and the difference is made up later ([`line`]). At the tool the
//! kinetic energy of the mass is kept out of what waves may spend; it stands behind the account when clay begins
//! unforeseen, up to `m / 2T`, 250 N s/m.
//!
//! # Line
//!
//! Play-out at constant delay, energy of lost waves, drift: see [`line`].
//!
//! # Echoes
//!
//! A tool in free air or in hard clay sends back all it gets, and a handle whose servo lags sends back *more*: with
//! [KHMH03]'s servo, `b` = 20 N s/m and a resting arm its reflection is 1.67 at 51 rad/s, 2.1 with an arm that holds on
//! firmly. Together they would swing at any delay. A damper at the tool equal to `b` would swallow the wave, and be
//! felt always: 20 N s/m in free air, on top of 20 of clay. So the waves are low-passed instead, where they arrive, at
//! [`FILTER_RAD_S`]: twice through the filter the round trip's reflection stays below 0.86 at every frequency whatever
//! the clay, and nothing is felt in steady motion. Each pass costs 25 ms of delay. A filter gives out no more energy
//! than went in. For a larger `b` the reflection grows, so the filter is slower in proportion.
//!
//! # What it cannot do
//!
//! A line is a spring: `1 / K_displayed = 1 / K_clay + D / b` with the mean one-way delay `D`, filter and play-out
//! included. At 20 N s/m and 100 ms a wall has 160 N/m. The larger `b`, the stiffer the clay and the heavier the free
//! handle.

mod line;

use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, Header, ToolFrame};

use super::{Coupling, HandleController, HandlePort, ToolController, ToolPort, resistance_slope};
use crate::Vec3;
use crate::deadband::{Quantity, Signal};
use crate::motion_limiter::Recovery;
use crate::time::Timestamp;
use line::{Incoming, Outgoing, Sample};

/// Cut-off of the filter that every wave passes on arrival, rad/s, up to `b` = [`FILTER_IMPEDANCE_N_S_PER_M`].
pub const FILTER_RAD_S: f64 = 40.0;
/// Above this impedance the cut-off falls in proportion to `1 / b`, N s/m.
pub const FILTER_IMPEDANCE_N_S_PER_M: f64 = 20.0;
/// Share of `b` that resists motion in addition while a port has differences to make up: whoever moves pays for it.
const UPKEEP_SHARE: f64 = 0.1;

/// The line's constants.
#[derive(Clone, Copy, Debug)]
struct Medium {
    tick_s: f64,
    /// `b`, N s/m.
    impedance: f64,
    /// `s = sqrt(2 b)`.
    root: f64,
}

impl Medium {
    fn new(coupling: &Coupling) -> Self {
        let impedance = coupling.wave_impedance_n_s_per_m;
        Self {
            tick_s: coupling.tick_s,
            impedance,
            root: (2.0 * impedance).sqrt(),
        }
    }

    fn filter_rad_s(&self) -> f64 {
        FILTER_RAD_S * (FILTER_IMPEDANCE_N_S_PER_M / self.impedance).min(1.0)
    }
}

/// What both ends do with waves.
struct Port {
    medium: Medium,
    incoming: Incoming,
    outgoing: Outgoing,
    /// The wave that acts in this tick.
    acting: Vec3,
}

impl Port {
    fn new(medium: Medium) -> Self {
        Self {
            medium,
            incoming: Incoming::new(medium),
            outgoing: Outgoing::new(medium),
            acting: Vec3::zeros(),
        }
    }

    /// As new, with the memory that it has.
    fn restart(&mut self) {
        self.incoming.restart();
        self.outgoing = Outgoing::new(self.medium);
        self.acting = Vec3::zeros();
    }

    fn on_frame(&mut self, now: Timestamp, header: &Header, sample: Sample) {
        if header.scheme == Scheme::Wave {
            self.incoming.on_sample(now, header, sample);
        }
    }

    /// Forms the wave of a tick that is over: the port moved by `displacement`, m, and put `work_j` into this end, axis
    /// by axis.
    fn send(&mut self, displacement: Vec3, work_j: Vec3) {
        let medium = self.medium;
        let nominal = displacement * (medium.root / medium.tick_s) - self.acting;
        let came_j = self.acting.component_mul(&self.acting) * (0.5 * medium.tick_s);
        let left_over_j = self.outgoing.send(nominal, came_j + work_j);
        self.incoming.receive_energy(left_over_j);
    }

    fn upkeep(&self, axis: usize) -> f64 {
        UPKEEP_SHARE * self.medium.impedance * self.outgoing.need(axis)
    }
}

/// The handle's controller.
pub struct WaveHandle {
    port: Port,
}

impl WaveHandle {
    /// At rest, the line empty.
    pub fn new(coupling: &Coupling) -> Self {
        Self {
            port: Port::new(Medium::new(coupling)),
        }
    }
}

impl HandleController for WaveHandle {
    fn on_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        let sample = Sample::new(frame.wave, frame.wave_integral, frame.energy_in_j);
        self.port.on_frame(now, &frame.header, sample);
    }

    fn on_late_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.on_frame(now, frame);
    }

    fn on_news_again(&mut self) {
        self.port.incoming.restart();
    }

    fn reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        let work_j = -port.felt_force.component_mul(&port.displacement);
        self.port.send(port.displacement, work_j);
        self.port.acting = self.port.incoming.play(now);
        let Medium {
            impedance, root, ..
        } = self.port.medium;
        Vec3::from_fn(|axis, _| {
            let damping = impedance + self.port.upkeep(axis);
            root * self.port.acting[axis] - damping * port.velocity[axis]
        })
    }

    fn fill(&mut self, frame: &mut HandleFrame) {
        let sample = self.port.outgoing.sample();
        frame.wave = sample.wave.into();
        frame.wave_integral = sample.integral.into();
        frame.energy_in_j = sample.energy_j.into();
    }

    fn signal(&self, _frame: &HandleFrame) -> Option<Signal> {
        Some(Signal::force(
            self.port.outgoing.sample().wave * self.port.medium.root,
        ))
    }
}

/// The tool's controller.
pub struct WaveTool {
    coupling: Coupling,
    port: Port,
    reference: Vec3,
    /// Of the tool's mass at the handle's port.
    velocity: Vec3,
    /// Force of the line on the mass in the last tick, N at the handle's port.
    line_force: Vec3,
}

impl WaveTool {
    /// At rest with the handle at home, the line empty.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            port: Port::new(Medium::new(&coupling)),
            reference: Vec3::zeros(),
            velocity: Vec3::zeros(),
            line_force: Vec3::zeros(),
            coupling,
        }
    }

    fn kinetic_j(&self, velocity: Vec3) -> Vec3 {
        velocity.component_mul(&velocity) * (0.5 * self.coupling.felt_mass_kg())
    }
}

impl ToolController for WaveTool {
    fn on_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        let sample = Sample::new(frame.wave, frame.wave_integral, frame.energy_in_j);
        self.port.on_frame(now, &frame.header, sample);
    }

    fn on_late_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        self.on_frame(now, frame);
    }

    fn on_news_again(&mut self) {
        self.port.incoming.restart();
    }

    fn reference(&mut self, now: Timestamp, port: &ToolPort, _remote_gain: f64) -> Vec3 {
        self.port.acting = self.port.incoming.play(now);
        self.velocity = port.velocity / self.coupling.position_ratio;
        let Medium {
            tick_s,
            impedance,
            root,
        } = self.port.medium;
        let resistance = -self.coupling.felt(port.clay_force);
        let slope = resistance_slope(&self.coupling, port);
        let inertia = self.coupling.felt_mass_kg() / tick_s + slope;
        let next = Vec3::from_fn(|axis, _| {
            let damping = impedance + self.port.upkeep(axis);
            let push = root * self.port.acting[axis] - resistance[axis];
            (inertia * self.velocity[axis] + push) / (inertia + damping)
        });
        self.reference += next * (self.coupling.position_ratio * tick_s);
        self.reference
    }

    fn moved(&mut self, port: &ToolPort) {
        let displacement = port.displacement / self.coupling.position_ratio;
        let Medium {
            tick_s,
            impedance,
            root,
        } = self.port.medium;
        let velocity = displacement / tick_s;
        let work_j =
            port.clay_force.component_mul(&port.displacement) / self.coupling.power_ratio();
        let stored_j = self.kinetic_j(velocity) - self.kinetic_j(self.velocity);
        // As it was: sending changes what the port needs.
        self.line_force = Vec3::from_fn(|axis, _| {
            let damping = impedance + self.port.upkeep(axis);
            root * self.port.acting[axis] - damping * velocity[axis]
        });
        self.port.send(displacement, work_j - stored_j);
        self.velocity = velocity;
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.port.restart();
        self.reference = handle_position * self.coupling.position_ratio;
        self.velocity = Vec3::zeros();
        self.line_force = Vec3::zeros();
    }

    fn recovery(&self) -> Recovery {
        Recovery::Incremental
    }

    fn fill(&mut self, frame: &mut ToolFrame) {
        let sample = self.port.outgoing.sample();
        frame.wave = sample.wave.into();
        frame.wave_integral = sample.integral.into();
        frame.energy_in_j = sample.energy_j.into();
    }

    /// The hand feels a change of the wave against the force that the line carries, not against the wave.
    fn signal(&self, _frame: &ToolFrame) -> Option<Signal> {
        Some(Signal {
            quantity: Quantity::Force,
            value: self.port.outgoing.sample().wave * self.port.medium.root,
            against: self.line_force.norm(),
        })
    }
}
