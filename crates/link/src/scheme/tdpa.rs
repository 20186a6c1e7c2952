//! Time-domain passivity: velocity forward, force back, and at each port no more energy out than came in at the other.
//! Source: [HR02] for one port, [RAP10] for two with a delay between them, both in docs/papers.md.
//!
//! ```text
//! handle   F = f_t / A_h2 (received) + b_c v           P = F v       in the handle's port, felt = -F
//! tool     v_t = A_h1 (v_h + K_d (y_h - y_t / A_h1))                 received velocity and place
//!
//! each end    work > 0: E_in += work,  work < 0: E_out -= work       over a tick, from true displacement and true force
//! handle      E_out(handle) <= E_in(tool) as received:   if P < 0 and T |P| > at hand:  F <- F · at hand / (T |P|)
//! tool        E_out(tool) <= E_in(handle) as received:   v_t <- the largest share of v_t that costs no more than is at hand
//! ```
//!
//! `E_in` is cumulative and travels in every frame. It never falls, so a lost or late frame makes the receiver careful
//! and nothing else, and no clock is needed.
//!
//! The published corrections `F += -W / (T v²) v` and `v += -W / (T F²) F` are, in one dimension, the budget's scaling,
//! with a division that needs a cap near rest; a share needs none. Where they correct after the fact, here the tick's
//! cost is foreseen (the hand's velocity, the clay's resistance as the slope of its last answer) and what really
//! happened is observed after it. Foresight can fail in two ways, and each has its cushion. At the handle a force held
//! over a tick works half a tick longer than the sample says; the first [`RESERVE_J`] that the hand gives stay there to
//! cover it. At the tool clay may begin anywhere; so the energy of the tool's own mass at that speed must be at hand
//! and is not spent, which covers clay of up to `m / 2T`, 250 N s/m.
//!
//! Each axis has an account of its own. A stroke could pay for a swing across it if the axes shared one, and the sum
//! would still be passive; the clay here answers against the motion, so hardly any energy passes between axes, and
//! little is lost by the stricter count.
//!
//! The damper `b_c` is part of the channel. Without it a viscous clay locks up: a tool that may not move meets no
//! force, so the hand feels none and gives no energy, so the tool may not move. Energy beyond [`MOST_AT_HAND_J`] is
//! dropped: saved up in a calm stroke it could feed a swing for a long time.
//!
//! Cannot make the delayed force right: it only takes away what is active in it. The hand feels drag in free air, and
//! clay late; on a long line the tool waits for energy whenever the clay becomes harder. It keeps the channel passive,
//! not the handle: `G_h` lags, so that the handle itself is active from 3 Hz on, and clay beyond some 100 N s/m swings
//! without any network as well.

use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, ToolFrame};

use super::{Coupling, HandleController, HandlePort, ToolController, ToolPort, resistance_slope};
use crate::Vec3;
use crate::deadband::Signal;
use crate::energy::{Counter, Tank};
use crate::motion_limiter::Recovery;
use crate::safety::capped;
use crate::time::Timestamp;

/// `b_c`, N s/m: a quarter of the default clay in the shallowest cut of [KHMH03] Fig. 7.
pub const CHANNEL_DAMPING_N_S_PER_M: f64 = 5.0;
/// `K_d`, 1/s: what the tool lags behind by shrinks to a third in 0.2 s. Four times as fast, the lag itself would begin
/// to swing in thick clay.
pub const DRIFT_PER_S: f64 = 5.0;
/// Speed of that correction at most, m/s, at the handle's port: after a pause the tool comes back slowly.
pub const DRIFT_SPEED_M_S: f64 = 0.05;
/// Energy at hand at most, J: enough for a free tool of 0.5 kg at 0.4 m/s, a second of cutting at 40 mm/s and 1 N.
pub const MOST_AT_HAND_J: f64 = 0.04;
/// What a port keeps back for foresight that fails, J: a hundred reversals of a 2 N force at 5 m/s².
pub const RESERVE_J: f64 = 5e-4;
/// Share of what comes in that fills the reserve.
const RESERVE_SHARE: f64 = 0.1;
/// A received velocity is good for this long, s: two heartbeats of a deadband.
const HELD_S: f64 = 0.04;

/// Energy of one axis of one port.
#[derive(Clone, Copy, Debug)]
struct PortEnergy {
    /// Reported to the far end.
    in_j: f64,
    far: Counter,
    at_hand: Tank,
    reserve: Tank,
}

impl PortEnergy {
    const NONE: Self = Self {
        in_j: 0.0,
        far: Counter::NEW,
        at_hand: Tank::empty(MOST_AT_HAND_J),
        reserve: Tank::empty(RESERVE_J),
    };

    fn on_far_energy(&mut self, total_j: f64) {
        let gained_j = self.far.increment_j(total_j);
        self.at_hand.settle(gained_j);
    }

    /// Observes the work that went into the channel here in one tick.
    fn observe(&mut self, work_j: f64) {
        if 0.0 < work_j {
            let missing_j = RESERVE_J - self.reserve.level_j();
            let owed_j = -self.reserve.level_j().min(0.0);
            let kept_j = missing_j
                .min((RESERVE_SHARE * work_j).max(owed_j))
                .min(work_j);
            self.reserve.settle(kept_j);
            self.in_j += work_j - kept_j;
            return;
        }
        self.at_hand.settle(work_j);
        let overdrawn_j = self.at_hand.level_j().min(0.0);
        self.reserve.settle(overdrawn_j);
        self.at_hand.settle(-overdrawn_j);
    }
}

/// The handle's controller.
#[derive(Clone, Debug)]
pub struct TdpaHandle {
    coupling: Coupling,
    clay_force: Vec3,
    energy: [PortEnergy; 3],
}

impl TdpaHandle {
    /// At rest: nothing received, nothing at hand.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            clay_force: Vec3::zeros(),
            energy: [PortEnergy::NONE; 3],
        }
    }
}

impl TdpaHandle {
    /// Works with a frame, whatever scheme it says it is of.
    pub(super) fn take_in(&mut self, frame: &ToolFrame) {
        self.clay_force = Vec3::from(frame.force_n);
        for (energy, total_j) in self.energy.iter_mut().zip(frame.energy_in_j) {
            energy.on_far_energy(total_j);
        }
    }
}

impl HandleController for TdpaHandle {
    fn on_frame(&mut self, _now: Timestamp, frame: &ToolFrame) {
        if frame.header.scheme == Scheme::Tdpa {
            self.take_in(frame);
        }
    }

    fn reaction(&mut self, _now: Timestamp, port: &HandlePort) -> Vec3 {
        let received = self.coupling.felt(self.clay_force);
        Vec3::from_fn(|axis, _| {
            let energy = &mut self.energy[axis];
            energy.observe(-port.felt_force[axis] * port.displacement[axis]);
            let force = CHANNEL_DAMPING_N_S_PER_M * port.velocity[axis] - received[axis];
            let work_j = force * port.velocity[axis] * self.coupling.tick_s;
            -force * affordable_share(-work_j, energy.at_hand.at_hand_j())
        })
    }

    fn fill(&mut self, frame: &mut HandleFrame) {
        frame.energy_in_j = self.energy.map(|energy| energy.in_j);
    }

    fn signal(&self, frame: &HandleFrame) -> Option<Signal> {
        Some(Signal::velocity(Vec3::from(frame.velocity_m_s)))
    }
}

/// The tool's controller.
#[derive(Clone, Debug)]
pub struct TdpaTool {
    coupling: Coupling,
    handle_position: Vec3,
    handle_velocity: Vec3,
    held_s: f64,
    reference: Vec3,
    energy: [PortEnergy; 3],
}

impl TdpaTool {
    /// At rest with the handle at home.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            handle_position: Vec3::zeros(),
            handle_velocity: Vec3::zeros(),
            held_s: 0.0,
            reference: Vec3::zeros(),
            energy: [PortEnergy::NONE; 3],
        }
    }

    /// The velocity that the tool should have, m/s at the handle's port, cost not considered.
    fn setpoint(&mut self, port: &ToolPort) -> Vec3 {
        let since = self.held_s.min(HELD_S);
        let velocity = if self.held_s < HELD_S {
            self.handle_velocity
        } else {
            Vec3::zeros()
        };
        self.held_s += self.coupling.tick_s;
        let place = self.handle_position + self.handle_velocity * since;
        let lag = place - port.position / self.coupling.position_ratio;
        velocity + capped(lag * DRIFT_PER_S, DRIFT_SPEED_M_S)
    }
}

impl TdpaTool {
    /// Works with a frame, whatever scheme it says it is of.
    pub(super) fn take_in(&mut self, frame: &HandleFrame) {
        self.handle_position = Vec3::from(frame.position_m);
        self.handle_velocity = Vec3::from(frame.velocity_m_s);
        self.held_s = 0.0;
        for (energy, total_j) in self.energy.iter_mut().zip(frame.energy_in_j) {
            energy.on_far_energy(total_j);
        }
    }
}

impl ToolController for TdpaTool {
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        if frame.header.scheme == Scheme::Tdpa {
            self.take_in(frame);
        }
    }

    fn reference(&mut self, _now: Timestamp, port: &ToolPort, _remote_gain: f64) -> Vec3 {
        let tick_s = self.coupling.tick_s;
        let setpoint = self.setpoint(port);
        let velocity = port.velocity / self.coupling.position_ratio;
        let resistance = -self.coupling.felt(port.clay_force);
        let slope = resistance_slope(&self.coupling, port);
        let half_mass_kg = 0.5 * self.coupling.felt_mass_kg();
        let afforded = Vec3::from_fn(|axis, _| {
            let setpoint = setpoint[axis];
            let cost = Cost {
                quadratic_j: setpoint * setpoint * (tick_s * slope + half_mass_kg),
                linear_j: tick_s * (resistance[axis] - slope * velocity[axis]) * setpoint,
            };
            setpoint * cost.affordable_share(self.energy[axis].at_hand.at_hand_j())
        });
        self.reference += afforded * (self.coupling.position_ratio * tick_s);
        self.reference
    }

    fn moved(&mut self, port: &ToolPort) {
        for (axis, energy) in self.energy.iter_mut().enumerate() {
            let work_on_clay_j = -port.clay_force[axis] * port.displacement[axis];
            energy.observe(-work_on_clay_j / self.coupling.power_ratio());
        }
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.handle_position = handle_position;
        self.handle_velocity = Vec3::zeros();
        self.held_s = 0.0;
        self.reference = handle_position * self.coupling.position_ratio;
        self.energy = [PortEnergy::NONE; 3];
    }

    fn recovery(&self) -> Recovery {
        Recovery::Incremental
    }

    fn fill(&mut self, frame: &mut ToolFrame) {
        frame.energy_in_j = self.energy.map(|energy| energy.in_j);
    }

    fn signal(&self, frame: &ToolFrame) -> Option<Signal> {
        Some(Signal::force(Vec3::from(frame.force_n)))
    }
}

/// The share, 0 to 1, of something that costs `cost_j` which `at_hand_j` pays for. What costs nothing can be had in
/// full.
fn affordable_share(cost_j: f64, at_hand_j: f64) -> f64 {
    if cost_j <= at_hand_j {
        1.0
    } else {
        at_hand_j / cost_j
    }
}

/// What a share `x` of a motion costs: `quadratic_j x² + linear_j x`.
#[derive(Clone, Copy, Debug)]
struct Cost {
    quadratic_j: f64,
    linear_j: f64,
}

impl Cost {
    /// The largest share up to 1 that costs no more than is at hand.
    fn affordable_share(self, at_hand_j: f64) -> f64 {
        let Self {
            quadratic_j: a,
            linear_j: c,
        } = self;
        if a + c <= at_hand_j {
            return 1.0;
        }
        // The positive root, written so that nothing cancels where the clay resists (0 < c).
        let root = (c * c + 4.0 * a * at_hand_j).sqrt();
        let share = if 0.0 < c {
            2.0 * at_hand_j / (c + root)
        } else {
            (root - c) / (2.0 * a)
        };
        share.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Nobody pays more than is at hand, and nobody gets less than could be paid.
        #[test]
        fn the_affordable_share_costs_what_is_at_hand_or_is_the_whole(
            a in 1e-12_f64..1.0, c in -1.0_f64..1.0, at_hand in 0.0_f64..1.0
        ) {
            let cost = Cost { quadratic_j: a, linear_j: c };
            let share = cost.affordable_share(at_hand);
            let paid = a * share * share + c * share;
            prop_assert!((0.0..=1.0).contains(&share));
            prop_assert!(paid <= at_hand + 1e-9);
            prop_assert!(1.0 <= share || at_hand - 1e-9 <= paid);
        }

        /// In one dimension the share is the published correction: the force that makes the port's energy come out at
        /// zero.
        #[test]
        fn scaling_is_the_published_correction(
            force in 0.1_f64..10.0, velocity in -1.0_f64..-0.01, at_hand in 0.0_f64..1e-4
        ) {
            const TICK_S: f64 = 1e-3;
            let cost = -force * velocity * TICK_S;
            prop_assume!(at_hand < cost);
            let scaled = force * affordable_share(cost, at_hand);
            let w = at_hand - cost;
            let published = force - w / (TICK_S * velocity * velocity) * velocity;
            prop_assert!((scaled - published).abs() < 1e-9 * force.max(1.0));
        }

        /// Whatever is observed, what a port reports and holds back is what came in, less what it overdrew.
        #[test]
        fn a_port_reports_no_energy_that_did_not_come_in(works in prop::collection::vec(-1e-3..1e-3, 1..300)) {
            let mut energy = PortEnergy::NONE;
            let mut sum: f64 = 0.0;
            for work in works {
                let before = energy.in_j;
                energy.observe(work);
                sum += work;
                prop_assert!(before <= energy.in_j);
                // Nothing was received from the far end, so all that went out was taken from the reserve.
                prop_assert!((energy.in_j + energy.reserve.level_j() - sum).abs() < 1e-12);
            }
        }
    }

    /// A calm stroke cannot save up for a long swing.
    #[test]
    fn what_is_at_hand_is_bounded() {
        let mut energy = PortEnergy::NONE;
        for tick in 0..1000 {
            energy.on_far_energy(f64::from(tick) * 1e-3);
        }
        assert!(energy.at_hand.at_hand_j() <= MOST_AT_HAND_J);
        assert!(0.9 * MOST_AT_HAND_J < energy.at_hand.at_hand_j());
    }
}
