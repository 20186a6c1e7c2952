//! Where the robot may go: as far from a singularity as its servos need, and no further.
//!
//! Clearance is the least of the posture's measures, from 1 down to 0 at a singularity: of each arm from stretched or
//! folded, and of the rods from one plane. The fence is the surface of one clearance. On the line from home to a
//! setpoint, with the fence at `D`, the handle goes along with the setpoint up to a margin `w` before the fence and
//! ever less beyond:
//!
//! ```text
//! place = setpoint                                        setpoint <= D - w
//!       = D - w + w tanh((setpoint - (D - w)) / w)        beyond
//! ```
//!
//! Place, speed and acceleration change smoothly, so a handle that runs into its fence is slowed down over the margin,
//! and the hand feels neither a blow nor an edge.

use teleclay_kinematics::{Branch, Geometry, Posture, Singularity};

use crate::Vec3;

/// The margin before the fence, m: a hand at 0.4 m/s is slowed down in it at half of gravity.
const MARGIN_M: f64 = 0.025;
/// Halvings of the line to home: a metre comes down to a picometre.
const HALVINGS: u32 = 40;

/// A robot's home and how near to a singularity it may come.
#[derive(Clone, Debug)]
pub(super) struct Fence {
    pub(super) geometry: Geometry,
    pub(super) branch: Branch,
    /// Home of the platform in the robot's frame, m.
    pub(super) home: Vec3,
    /// Least clearance.
    pub(super) clearance: f64,
}

impl Fence {
    /// What a setpoint for this displacement, m, comes to, and the joint angles there.
    pub(super) fn allow(&self, setpoint: Vec3) -> (Vec3, Vec3) {
        let far = setpoint.norm();
        let outwards = if far == 0.0 { setpoint } else { setpoint / far };
        let reach = far + MARGIN_M;
        if self.joints_within(outwards * reach).is_some()
            && let Some(joints) = self.joints_within(setpoint)
        {
            return (setpoint, joints);
        }
        let (mut edge, mut refused) = (0.0, reach);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (edge + refused);
            if self.joints_within(outwards * middle).is_some() {
                edge = middle;
            } else {
                refused = middle;
            }
        }
        // A home that lies near to the fence leaves half the way for the margin.
        let margin = MARGIN_M.min(0.5 * edge).max(f64::MIN_POSITIVE);
        let beyond = (far - (edge - margin)).max(0.0);
        let place = outwards * (far - beyond + margin * (beyond / margin).tanh());
        match self.joints_within(place) {
            Some(joints) => (place, joints),
            // Rounding at the very edge, or a reach with holes: home is always allowed, the robot was made there.
            None => (
                Vec3::zeros(),
                self.joints_within(Vec3::zeros())
                    .expect("home was checked when the robot was made"),
            ),
        }
    }

    fn joints_within(&self, displacement: Vec3) -> Option<Vec3> {
        let posture = self
            .geometry
            .posture(&(self.home + displacement), self.branch)
            .ok()?;
        (self.clearance <= clearance(&posture)).then(|| posture.joints_rad())
    }
}

/// How far a posture is from the nearest singularity, from 0 to 1.
pub(super) fn clearance(posture: &Posture) -> f64 {
    posture
        .serial_measures()
        .min()
        .min(posture.parallel_measure())
}

/// Which singularity is nearest.
pub(super) fn nearest(posture: &Posture) -> Singularity {
    let serial = posture.serial_measures();
    if serial.min() < posture.parallel_measure() {
        Singularity::Serial {
            arm: serial.imin() + 1,
        }
    } else {
        Singularity::Parallel
    }
}
