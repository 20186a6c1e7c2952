//! Which way the surface faces at a vertex, for the light on it: against the gradient of occupancy, smoothed.
//!
//! Occupancy changes only within a voxel of the surface. A gradient taken over two or three voxels would show each of
//! its 255 steps, and each step from voxel to voxel, as a facet; over five binomial ones light runs smoothly.

use super::cell::Vertex;
use super::window::{HALO, Window};

/// Voxels that are looked at along each axis: five about the cell's lower corner and five about its upper one.
const TAPS: usize = 6;
/// Binomial smoothing over five voxels, and its derivative, with a zero at either end to slide within six.
const SMOOTH: [f32; TAPS + 1] = [0.0, 1.0, 4.0, 6.0, 4.0, 1.0, 0.0];
const SLOPE: [f32; TAPS + 1] = [0.0, -1.0, -2.0, 0.0, 2.0, 1.0, 0.0];

/// Weights of the voxels along an axis.
struct Weights {
    smooth: [f32; TAPS],
    slope: [f32; TAPS],
}

impl Weights {
    /// For a place that lies this share of the way from its cell's lower corner to the upper one.
    fn at(share: f32) -> Self {
        let slid = |taps: [f32; TAPS + 1]| {
            std::array::from_fn(|tap| (1.0 - share) * taps[tap + 1] + share * taps[tap])
        };
        Self {
            smooth: slid(SMOOTH),
            slope: slid(SLOPE),
        }
    }
}

/// Out of the clay, of unit length, at a vertex of the brick that the window shows; up where occupancy is the same on
/// all sides.
pub(super) fn normal(window: &Window, vertex: &Vertex) -> [f32; 3] {
    let cell: [usize; 3] = std::array::from_fn(|axis| {
        (vertex.cell[axis] - window.first[axis] + HALO as i16) as usize - 2
    });
    let [x, y, z] = vertex.within(0.0).map(Weights::at);
    let mut gradient = [0.0_f32; 3];
    for k in 0..TAPS {
        let (mut along_x, mut along_y, mut along_z) = (0.0, 0.0, 0.0);
        for j in 0..TAPS {
            let row = &window.occupancies[cell[2] + k][cell[1] + j][cell[0]..cell[0] + TAPS];
            let (mut smooth, mut slope) = (0.0, 0.0);
            for (tap, &occupancy) in row.iter().enumerate() {
                let occupancy = f32::from(occupancy);
                smooth += x.smooth[tap] * occupancy;
                slope += x.slope[tap] * occupancy;
            }
            along_x += y.smooth[j] * slope;
            along_y += y.slope[j] * smooth;
            along_z += y.smooth[j] * smooth;
        }
        gradient[0] += z.smooth[k] * along_x;
        gradient[1] += z.smooth[k] * along_y;
        gradient[2] += z.slope[k] * along_z;
    }
    let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
    if length <= 0.0 {
        return [0.0, 0.0, 1.0];
    }
    gradient.map(|g| -g / length)
}
