//! Engaged area: how much of the tool's leading face has clay in front of it.
//!
//! ```text
//! A(d) = integral over the tool's surface of  e(x) max(n . d, 0) dS
//! ```
//!
//! with `n` the outward normal, `d` the direction of motion and `e` 1 where clay stands ahead, 0 where air does. A ball
//! wholly in clay has `pi r^2`, a blade its width times the depth of cut, an upright cylinder its diameter times that, a
//! loop drawn flat through clay the ring of its wire, `2 pi R d` for a wire of thickness `d`. The integral is a sum over points that are
//! fixed in the tool, so what is summed does not depend on the speed, and a removed volume never has to be divided by a
//! small step.
//!
//! `e` is read where, going from a point of the face in the direction of motion, one voxel ([`LOOK_AHEAD_VOXELS`]) lies
//! between the place and the face: straight ahead that is one voxel on, towards the rim of a ball some voxels. Seen
//! along the motion, the place then covers the point it stands for, and clay that ends across the motion is measured
//! without bias. Occupancy there is interpolated between voxel centres and saturated, so that a face which has just cut
//! its way reads full clay wherever between the voxels it stands, the edge of engaged clay is found between voxels too,
//! and the walls of a cut, which hold half at the rim of the tool that made it, do not count.

mod points;
mod rod;
mod sampler;

use crate::field::Field;
use crate::lanes::{Work, widely};
use crate::pose::Pose;

pub(crate) use points::Faces;
pub use points::{Tool, row_spacing_m};
use sampler::Sampler;

/// How far from its faces a tool feels for clay, in voxels: where a cut's ramp ends and the clay ahead is whole.
pub const LOOK_AHEAD_VOXELS: f64 = 1.0;

/// Directions whose cosine is above this share the points that are felt.
const NEARLY_PARALLEL: f64 = 0.98;

/// Engaged areas of a tool's faces at a pose for two unit directions, m². A zero direction engages nothing.
pub(crate) fn engaged_areas_m2(
    field: &Field,
    faces: &Faces,
    pose: Pose,
    directions: [[f64; 3]; 2],
) -> [f64; 2] {
    let sampler = Sampler::new(field, faces, pose);
    if sampler.is_in_air(faces) {
        return [0.0; 2];
    }
    let [a, b] = directions;
    let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if NEARLY_PARALLEL < cosine {
        let sum = std::array::from_fn(|axis| a[axis] + b[axis]);
        let length = (2.0 + 2.0 * cosine).sqrt();
        return widely(FeelClose {
            sampler,
            faces,
            ahead: sum.map(|d: f64| d / length),
            directions,
        });
    }
    directions.map(|ahead| {
        if ahead.iter().all(|d| d.abs() <= 0.0) {
            return 0.0;
        }
        widely(Feel {
            sampler,
            faces,
            ahead,
        })
    })
}

/// Clay about to be felt for in a direction.
struct Feel<'a> {
    sampler: Sampler<'a>,
    faces: &'a Faces,
    ahead: [f64; 3],
}

/// Clay about to be felt for in the direction between two that are close to each other.
struct FeelClose<'a> {
    sampler: Sampler<'a>,
    faces: &'a Faces,
    ahead: [f64; 3],
    directions: [[f64; 3]; 2],
}

impl Work for Feel<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        self.sampler.area_m2(self.faces, self.ahead)
    }
}

impl Work for FeelClose<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        self.sampler
            .areas_close_m2(self.faces, self.ahead, self.directions)
    }
}
