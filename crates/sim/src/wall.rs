//! The naive wall across a network: the measuring stick for every claim about delay.
//!
//! A mass with damping, held by nobody, touches a spring on the far side. Its position goes up the line each tick, the
//! spring's force comes down and is held until the next one. Nothing compensates the delay, so the loop turns unstable
//! at a stiffness that is known in closed form (`teleclay_control` has it); a simulator that turns unstable elsewhere
//! is wrong, and so would be its every other figure.

use std::time::Duration;

use teleclay_link::conditioner::{Conditioner, Impairment};
use teleclay_link::time::Timestamp;

/// The mass and the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallSetup {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Viscous damping of the mass, N s/m, above zero.
    pub damping_n_s_per_m: f64,
    /// Tick, s.
    pub tick_s: f64,
    /// What the line up does.
    pub up: Impairment,
    /// What the line down does.
    pub down: Impairment,
}

/// Measures, to 0.1 %, the stiffness at which the delayed wall turns unstable, N/m: between `at_least`, stable, and
/// `at_most`, unstable.
pub fn measured_critical_stiffness(setup: &WallSetup, at_least: f64, at_most: f64) -> f64 {
    let (mut stable, mut unstable) = (at_least, at_most);
    while 1.001 * stable < unstable {
        let middle = (stable * unstable).sqrt();
        if grows(setup, middle) {
            unstable = middle;
        } else {
            stable = middle;
        }
    }
    (stable * unstable).sqrt()
}

/// Whether a wall of this stiffness builds up a swing from a small push: the energy of the last sixth of a long run
/// against that of the second.
pub fn grows(setup: &WallSetup, stiffness_n_per_m: f64) -> bool {
    // Long enough for three hundred swings of the undelayed wall, and never less than a minute.
    let period_s = std::f64::consts::TAU * (setup.mass_kg / stiffness_n_per_m).sqrt();
    let ticks = ((300.0 * period_s).max(60.0) / setup.tick_s) as u64;
    let mut wall = Wall::new(setup, stiffness_n_per_m);
    let sixth = ticks / 6;
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for tick in 0..ticks {
        let energy = wall.step();
        if 1e12 < energy {
            return true;
        }
        if (sixth..2 * sixth).contains(&tick) {
            early += energy;
        } else if 5 * sixth <= tick {
            late += energy;
        }
    }
    early < late
}

struct Wall {
    stiffness: f64,
    mass: f64,
    /// Exact motion of the mass over one tick under a held force.
    decay: f64,
    coast: f64,
    damping: f64,
    tick_s: f64,
    position: f64,
    velocity: f64,
    force: f64,
    up: Conditioner<f64>,
    down: Conditioner<f64>,
    now: Timestamp,
}

impl Wall {
    fn new(setup: &WallSetup, stiffness: f64) -> Self {
        let decay = (-setup.damping_n_s_per_m * setup.tick_s / setup.mass_kg).exp();
        Self {
            stiffness,
            mass: setup.mass_kg,
            decay,
            coast: (1.0 - decay) * setup.mass_kg / setup.damping_n_s_per_m,
            damping: setup.damping_n_s_per_m,
            tick_s: setup.tick_s,
            position: 1e-3,
            velocity: 0.0,
            force: 0.0,
            up: Conditioner::new(setup.up, 1, 4096),
            down: Conditioner::new(setup.down, 2, 4096),
            now: Timestamp::ZERO,
        }
    }

    /// One tick; returns kinetic energy plus that of the spring where it is, J.
    fn step(&mut self) -> f64 {
        self.up.push(self.now, self.position);
        while let Some(position) = self.up.poll(self.now) {
            self.down.push(self.now, -self.stiffness * position);
        }
        while let Some(force) = self.down.poll(self.now) {
            self.force = force;
        }
        // m dv/dt = F - b v under constant F, exactly.
        let terminal = self.force / self.damping;
        let excess = self.velocity - terminal;
        self.position += terminal * self.tick_s + excess * self.coast;
        self.velocity = terminal + excess * self.decay;
        self.now = self.now.after(Duration::from_secs_f64(self.tick_s));
        0.5 * self.mass * self.velocity * self.velocity
            + 0.5 * self.stiffness * self.position * self.position
    }
}
