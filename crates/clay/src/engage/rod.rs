//! Where a cylinder and a loop look for clay: where their motion leaves the rod that they remove, grown by what is felt
//! ahead.

use super::points::FacePairs;
use crate::lanes::F32x4;
use crate::tool::{Cylinder, WireLoop};

/// A wall that slants against the motion by a cosine of less than this is felt nearer than the rod's own outline, so as
/// not to reach far along it. Little of it counts.
const LEAST_COSINE: f32 = 0.25;

/// The rod that a tool removes, and whether only a wire along its rim feels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RodFaces {
    axis: usize,
    radius_m: f64,
    half_m: f64,
    is_wire: bool,
}

/// The same on a grid, in the steps that places are counted in.
#[derive(Clone, Copy)]
pub(super) struct RodReach {
    axis: usize,
    /// Of the rod, grown.
    radius: f32,
    half: f32,
    look_ahead: f32,
    /// Farthest that a point looks; a wire looks to the end of the disc that it encloses, however far that is.
    most: f32,
    is_wire: bool,
}

impl RodFaces {
    pub(super) fn of_cylinder(cylinder: &Cylinder) -> Self {
        Self {
            axis: 2,
            radius_m: cylinder.radius_m(),
            half_m: 0.5 * cylinder.height_m(),
            is_wire: false,
        }
    }

    pub(super) fn of_loop(wire_loop: &WireLoop) -> Self {
        Self {
            axis: 0,
            radius_m: wire_loop.disc_radius_m(),
            half_m: 0.5 * wire_loop.wire_diameter_m(),
            is_wire: true,
        }
    }

    /// Area of a cylinder seen along a direction, m². That of a wire, parts of which hide others, is left to its points.
    pub(super) fn seen_m2(&self, ahead: [f32; 3]) -> Option<f64> {
        if self.is_wire {
            return None;
        }
        let along = f64::from(ahead[self.axis]).abs();
        let across = (1.0 - along * along).max(0.0).sqrt();
        let wall_m2 = 4.0 * self.radius_m * self.half_m;
        let end_m2 = std::f64::consts::PI * self.radius_m * self.radius_m;
        Some(wall_m2 * across + end_m2 * along)
    }

    pub(super) fn on_grid(&self, steps_per_metre: f64, look_ahead: f32) -> RodReach {
        let radius = (self.radius_m * steps_per_metre) as f32;
        let half = (self.half_m * steps_per_metre) as f32;
        // As far as a point at the side of the wall looks straight across the axis, or as a flat face does.
        let tangent = (look_ahead * (2.0 * radius + look_ahead)).sqrt();
        RodReach {
            axis: self.axis,
            radius: radius + look_ahead,
            half: half + look_ahead,
            look_ahead,
            most: if self.is_wire {
                f32::MAX
            } else {
                tangent.max(look_ahead / LEAST_COSINE)
            },
            is_wire: self.is_wire,
        }
    }
}

impl RodReach {
    /// How far ahead of points at these offsets from the tool's middle the motion leaves the grown rod.
    ///
    /// Of a wire's inner side, only what looks out through a face of the disc has clay of its own ahead. What looks out
    /// through the rim runs in the slot of the wire in front of it, and is told of what stands right ahead of itself.
    #[inline(always)]
    pub(super) fn reach(
        &self,
        at: [F32x4; 3],
        pairs: &FacePairs,
        side: F32x4,
        ahead: [f32; 3],
    ) -> F32x4 {
        let none = F32x4::splat(0.0);
        let (b, c) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let (ahead_a, ahead_b, ahead_c) = (ahead[self.axis], ahead[b], ahead[c]);
        // Through an end: |w + s a| = h.
        let along = at[self.axis] * F32x4::splat(if ahead_a < 0.0 { -1.0 } else { 1.0 });
        let by_end = (F32x4::splat(self.half) - along) / F32x4::splat(ahead_a.abs());
        // Through the wall: |q + s d|^2 = r^2.
        let squared = F32x4::splat(ahead_b * ahead_b + ahead_c * ahead_c);
        let outward = at[b] * F32x4::splat(ahead_b) + at[c] * F32x4::splat(ahead_c);
        let within = F32x4::splat(self.radius * self.radius) - (at[b] * at[b] + at[c] * at[c]);
        let root = (outward * outward + squared * within).max(none).sqrt();
        let by_wall = within / (outward + root).max(F32x4::splat(f32::MIN_POSITIVE));
        let reach = by_wall.min(by_end).min(F32x4::splat(self.most));
        if !self.is_wire {
            return reach;
        }
        let facing = at[b] * F32x4::load(&pairs.normal[b]) + at[c] * F32x4::load(&pairs.normal[c]);
        let inner = by_wall.where_below(by_end, F32x4::splat(self.look_ahead), reach);
        (side * facing).where_below(none, inner, reach)
    }
}
