//! Engaged area by class of material.
//!
//! Clay ahead of a point counts as it does without classes; which class it counts for follows from the voxels that it
//! is read from. Where they are of several classes, the area is shared out by what each class adds to the interpolated
//! occupancy: air counts for none, and going from one class into another the force goes from one to the other over a
//! voxel. The areas of all classes add up to the area without classes.

use super::{BRICK_EDGE, Faces, PLACES, SCALE, Sampler, engaged};
use crate::classes::{Classes, MAX_CLASSES};
use crate::lanes::{F32x4, I32x4, LANES};

impl Sampler<'_> {
    /// Engaged areas of each class in directions close to `ahead`, the direction in which clay is felt, m².
    pub(in crate::engage) fn class_areas_m2<const N: usize>(
        &self,
        classes: &Classes,
        faces: &Faces,
        ahead: [f64; 3],
        directions: [[f64; 3]; N],
    ) -> [[f64; MAX_CLASSES]; N] {
        let ahead = ahead.map(|d| d as f32);
        let directions = directions.map(|direction| direction.map(|d| d as f32));
        let none = F32x4::splat(0.0);
        let mut sums_m2 = [[0.0; MAX_CLASSES]; N];
        let mut whole_m2 = none;
        for pairs in &faces.pairs {
            let (cosine, area_m2) = (pairs.along(ahead), F32x4::load(&pairs.area_m2));
            let (side, cosine) = faces.leading(cosine);
            let seen_m2 = cosine * area_m2;
            if !seen_m2.any_above_0() {
                continue;
            }
            whole_m2 = whole_m2 + seen_m2;
            let places = self.places(pairs, side, cosine, ahead);
            let corners = self.corners(places);
            let engaged_m2 = engaged(places, corners) * area_m2;
            if !engaged_m2.any_above_0() {
                continue;
            }
            let engaged_m2 = directions.map(|direction| {
                let cosine = (side * pairs.along(direction)).max(none);
                (engaged_m2 * cosine).to_array()
            });
            for lane in 0..LANES {
                let shares = shares(classes, places, corners[lane], lane);
                for (sums_m2, engaged_m2) in sums_m2.iter_mut().zip(&engaged_m2) {
                    for (sum_m2, share) in sums_m2.iter_mut().zip(shares) {
                        *sum_m2 += f64::from(engaged_m2[lane]) * share;
                    }
                }
            }
        }
        let correction = Self::correction(faces, ahead, whole_m2);
        sums_m2.map(|sums_m2| sums_m2.map(|sum_m2| sum_m2 * correction))
    }
}

/// What each class has of the clay that is read at a place. Adds up to 1, or to 0 where there is only air.
fn shares(classes: &Classes, places: [I32x4; 3], corners: u64, lane: usize) -> [f64; MAX_CLASSES] {
    let mut shares = [0.0; MAX_CLASSES];
    if corners == 0 {
        return shares;
    }
    let places = places.map(|place| place.to_array()[lane]);
    let lowest = places.map(|place| (place >> PLACES) - BRICK_EDGE as i32);
    if let Some(class) = classes.one_about(lowest) {
        shares[class] = 1.0;
        return shares;
    }
    let beyond = places.map(|place| f64::from(place & ((1 << PLACES) - 1)) / f64::from(SCALE));
    let mut whole = 0.0;
    for (corner, occupancy) in corners.to_le_bytes().into_iter().enumerate() {
        let mut weight = f64::from(occupancy);
        let voxel = std::array::from_fn(|axis| {
            let is_beyond = corner >> axis & 1;
            weight *= if is_beyond == 1 {
                beyond[axis]
            } else {
                1.0 - beyond[axis]
            };
            lowest[axis] + is_beyond as i32
        });
        shares[classes.at(voxel)] += weight;
        whole += weight;
    }
    if 0.0 < whole {
        shares = shares.map(|share| share / whole);
    }
    shares
}
