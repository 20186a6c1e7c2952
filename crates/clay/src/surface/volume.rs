//! The surface that encloses as much as there is clay.
//!
//! For a given set of voxels that count as clay, the enclosed volume is a continuous function of how far the vertices
//! are shifted, but for how quadrilaterals are cut into triangles. The right shift is found between one that encloses
//! too little and one that encloses too much: by secants, and by halving where a secant leads out of the interval.
//!
//! Voxels count as clay from half of solid on. Where much of what is left lies in films and specks below that, the
//! surface of the rest would have to leave it by more than [`FAR`]; clay counts from a lower occupancy on then.

use crate::clay::{Clay, UNITS_PER_VOXEL};
use crate::field::SOLID;

use super::draft::Draft;

/// Occupancy from which on a voxel counts as clay, normally: above half of solid.
pub(super) const HALF_SOLID: u8 = SOLID / 2 + 1;
/// Largest shift for which the surface is taken as it is, voxels: together with how far a crossing is from where it
/// should be, it is less than half a voxel.
const FAR: f64 = 0.25;
/// No vertex moves any further, as its outward direction is of unit length and the diagonal of a cell is shorter.
const FARTHEST: f64 = 1.75;
/// Share of the clay to which the enclosed volume is matched.
const TOLERANCE: f64 = 1e-3;
/// Halvings that narrow the interval of shifts to a millionth of a voxel.
const MOST_STEPS: usize = 22;

/// A shift, and how much is missing then.
#[derive(Clone, Copy, Debug)]
struct Fit {
    shift: f64,
    /// Volume that should be enclosed and is not, as a share of what should be.
    missing: f64,
}

impl Fit {
    fn is_exact(&self) -> bool {
        self.missing.abs() <= TOLERANCE
    }

    /// Whether it needs no lower occupancy: more clay would only enclose more.
    fn is_good(&self) -> bool {
        self.shift <= FAR && self.missing <= TOLERANCE
    }

    fn is_better_than(&self, other: &Self) -> bool {
        match (self.is_exact(), other.is_exact()) {
            (true, true) => self.shift.abs() < other.shift.abs(),
            (false, false) => self.missing.abs() < other.missing.abs(),
            (exact, _) => exact,
        }
    }
}

/// The clay's surface and how far its vertices are to be shifted; none if there is no clay.
pub(super) fn fitted(clay: &Clay) -> Option<(Draft, f32)> {
    let target = clay.remaining_units() as f64 / UNITS_PER_VOXEL as f64;
    if clay.remaining_units() == 0 {
        return None;
    }
    let mut best: Option<(Draft, Fit)> = None;
    let mut clay_from = HALF_SOLID;
    while clay_from != 0 {
        let draft = Draft::of(clay, clay_from);
        let fit = fit(&draft, target);
        if best
            .as_ref()
            .is_none_or(|(_, best)| fit.is_better_than(best))
        {
            best = Some((draft, fit));
        }
        if fit.is_good() {
            break;
        }
        clay_from /= 2;
    }
    best.map(|(draft, fit)| (draft, fit.shift as f32))
}

/// The shift at which a surface encloses a volume, in voxels, or comes nearest to it.
fn fit(draft: &Draft, target: f64) -> Fit {
    let mut places = Vec::new();
    let (mut low, mut high) = (-FARTHEST, FARTHEST);
    let mut shift = 0.0;
    let mut best: Option<Fit> = None;
    let mut before: Option<(f64, f64)> = None;
    for _ in 0..MOST_STEPS {
        let extent = draft.extent(shift as f32, &mut places);
        let lacking = target - extent.volume;
        let here = Fit {
            shift,
            missing: lacking / target,
        };
        let best = best.get_or_insert(here);
        if here.missing.abs() < best.missing.abs() {
            *best = here;
        }
        if here.is_exact() || extent.area <= 0.0 {
            break;
        }
        if 0.0 < lacking {
            low = shift;
        } else {
            high = shift;
        }
        // At first, a shift adds its depth all over the surface.
        let gain = before.map_or(extent.area, |(shift_before, lacking_before)| {
            (lacking_before - lacking) / (shift - shift_before)
        });
        before = Some((shift, lacking));
        let next = shift + lacking / gain;
        shift = if low < next && next < high {
            next
        } else {
            0.5 * (low + high)
        };
    }
    best.expect("there was a step")
}
