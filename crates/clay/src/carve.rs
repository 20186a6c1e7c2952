//! Cutting: field <- min(field, what the swept solid leaves over).
//!
//! A sweep leaves over, in a voxel whose centre is at the signed distance `g` outside the swept solid, the share
//!
//! ```text
//! clamp(1/2 + g / 2h) * 255, rounded to nearest, ties to even
//! ```
//!
//! a ramp two voxels wide with the solid's surface in its middle, so that the surface can be found again between
//! voxels. The share is a function of the sweep and the voxel's index alone. Only additions, multiplications,
//! divisions, square roots and comparisons in IEEE single and double precision go into it, each rounded on its own, so
//! every machine gets the same bits.
//!
//! A sweep is cut in two parts: the solid where it starts, and what it pushes ahead of itself from there to its end.
//! The first part is left out where it is known to be cut already ([`Cleared`]), as in every tick but a tool's first.
//! The second part looks at no voxel that the solid at the start leaves nothing of, or less of than what comes after:
//! only at a thin shell in front of the tool.
//!
//! Bricks are cut one by one, in tiles of four rows by four voxels ([`InBrick`]). Which tiles are looked at is bounded
//! generously: looking at more never changes the result, and a tile is left out only where no share can be below what
//! is there. Processors foresee badly which tiles these are, so they are listed first, without branches, and then cut.

mod ball;
mod blade;
mod capsule;
mod cleared;
mod cover;
mod list;
mod mesh;
mod rod;
mod segment;
mod tables;

use crate::bake::Baked;
use crate::changes::Changes;
use crate::field::{Brick, Field};
use crate::grid::BRICK_EDGE;
use crate::lanes::{Removed, Tile, Work, widely};
use crate::pose::Pose;
use crate::sweep::Sweep;
use crate::tool::ToolShape;

use ball::BallStep;
use blade::BladeSweep;
use capsule::CapsuleSweep;
use list::List;
use mesh::{MeshAt, places};
use rod::{Rod, RodSweep};
use segment::Segment;
use tables::BrickAt;

pub(crate) use cleared::{Cleared, Start};
pub(crate) use cover::{Part, covered, end_bounds};
pub(crate) use tables::Tables;

/// Half width of the ramp from air to solid, in voxels.
const RAMP: f64 = 1.0;
/// What is left over grows along the ramp by this, in units a voxel.
const UNITS_PER_VOXEL: f64 = 127.5;
/// What is left over at the solid's surface, in units.
const HALF_UNITS: f64 = 127.5;
/// By how much tiles are chosen generously, in voxels, beyond what rounding in single precision asks for.
const SLACK: f64 = 0.01;
const EDGE: i32 = BRICK_EDGE as i32;

/// Removes what the sweep passes through; returns how many 1/255 of a voxel that was. Allocates nothing.
pub(crate) fn carve(
    field: &mut Field,
    changes: &mut Changes,
    tables: &mut Tables,
    sweep: &Sweep,
    start: Start,
) -> u64 {
    let segment = Segment::new(sweep, field.grid().voxel_size_m());
    let before = field.total();
    let mut carver = Carver {
        revision: changes.upcoming(),
        field,
        changes,
        tables,
        bands: List::new(),
        work: List::new(),
    };
    take_solids(sweep, &segment, start, &mut carver);
    before - field.total()
}

/// Likewise by a mesh that goes straight from one pose to another.
pub(crate) fn carve_mesh(
    field: &mut Field,
    changes: &mut Changes,
    tables: &mut Tables,
    baked: &Baked,
    [from, to]: [Pose; 2],
    start: Start,
) -> u64 {
    let segment = Segment::between(from, to, field.grid().voxel_size_m());
    let before = field.total();
    let mut carver = Carver {
        revision: changes.upcoming(),
        field,
        changes,
        tables,
        bands: List::new(),
        work: List::new(),
    };
    if start == Start::Unknown {
        carver.take(&MeshAt::new(baked, segment.from, segment.per_metre));
    }
    if !segment.is_standing() {
        for place in places(&segment) {
            carver.take(&MeshAt::new(baked, place, segment.per_metre));
        }
    }
    before - field.total()
}

/// Whoever is given the solids that a sweep is made of.
trait Take {
    fn take<S: Solid>(&mut self, solid: &S);
}

/// The solids that a sweep is made of: the tool where it starts, unless that is clear, and what it pushes ahead of
/// itself from there.
fn take_solids(sweep: &Sweep, segment: &Segment, start: Start, take: &mut impl Take) {
    let (sets_down, moves) = (start == Start::Unknown, !segment.is_standing());
    match &sweep.shape {
        ToolShape::Ball(ball) => {
            if sets_down {
                take.take(&BallStep::set_down(ball, segment));
            }
            if moves && BallStep::suits(ball, segment) {
                take.take(&BallStep::new(ball, segment));
            } else if moves {
                take.take(&CapsuleSweep::new(ball, segment));
            }
        }
        ToolShape::Blade(blade) => {
            if sets_down {
                take.take(&BladeSweep::set_down(blade, segment));
            }
            if moves {
                take.take(&BladeSweep::new(blade, segment));
            }
        }
        ToolShape::Cylinder(cylinder) => {
            take_rod::<2>(&Rod::upright(cylinder), segment, start, take);
        }
        ToolShape::Loop(wire_loop) => {
            take_rod::<0>(&Rod::within(wire_loop), segment, start, take);
        }
    }
}

fn take_rod<const AXIS: usize>(rod: &Rod, segment: &Segment, start: Start, take: &mut impl Take) {
    if start == Start::Unknown {
        take.take(&RodSweep::<AXIS>::set_down(rod, segment));
    }
    if !segment.is_standing() {
        take.take(&RodSweep::<AXIS>::new(rod, segment));
    }
}

/// A swept solid, ready to cut one grid.
trait Solid {
    /// Voxels that can be affected, along each axis from the first up to but not including the last.
    fn bounds(&self) -> [[i32; 2]; 3];

    /// Notes what matters of each axis in these bricks.
    fn prepare(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]);

    /// Whether a brick can be affected.
    fn reaches(&self, at: BrickAt) -> bool;

    /// What matters in a brick.
    fn in_brick<'a>(&'a self, tables: &'a Tables, at: BrickAt) -> impl InBrick + 'a;
}

/// A swept solid in one brick: in layers along z, each of four bands of four rows, each of four tiles.
trait InBrick {
    /// Which bands of a layer may change, a bit each.
    fn bands(&self, layer: usize) -> u32;

    /// Which tiles of a band may change, a bit each.
    fn tiles(&self, layer: usize, band: usize) -> u32;

    /// What is left over in a tile.
    fn leaves(&self, at: TileIndex) -> Tile;
}

/// A tile's place in its brick: 16 times the layer plus 4 times the band plus the tile's number in the band.
#[derive(Clone, Copy)]
struct TileIndex(u8);

impl TileIndex {
    #[inline(always)]
    fn layer(self) -> usize {
        usize::from(self.0 >> 4)
    }

    #[inline(always)]
    fn band(self) -> usize {
        usize::from(self.0 >> 2 & 3)
    }

    #[inline(always)]
    fn tile(self) -> usize {
        usize::from(self.0 & 3)
    }
}

/// What is cut, where that is noted, and what to look at in the brick at hand.
struct Carver<'a> {
    field: &'a mut Field,
    changes: &'a mut Changes,
    revision: u64,
    tables: &'a mut Tables,
    bands: List,
    work: List,
}

/// A solid about to be cut.
struct Cut<'a, 'k, S> {
    carver: &'a mut Carver<'k>,
    solid: &'a S,
}

impl<S: Solid> Work for Cut<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.carver.cut_bricks(self.solid);
    }
}

impl Take for Carver<'_> {
    fn take<S: Solid>(&mut self, solid: &S) {
        widely(Cut {
            carver: self,
            solid,
        });
    }
}

impl Carver<'_> {
    #[inline(always)]
    fn cut_bricks<S: Solid>(&mut self, solid: &S) {
        let voxels = self.field.grid().voxels().map(i32::from);
        let bounds = solid.bounds();
        let [xs, ys, zs]: [[i32; 2]; 3] =
            std::array::from_fn(|axis| [bounds[axis][0].max(0), bounds[axis][1].min(voxels[axis])]);
        if xs[1] <= xs[0] || ys[1] <= ys[0] || zs[1] <= zs[0] {
            return;
        }
        let [bricks_x, bricks_y, _] = self.field.grid().bricks().map(usize::from);
        let bricks = [xs, ys, zs].map(|[start, end]| [start / EDGE, (end - 1) / EDGE + 1]);
        let [along_x, along_y, along_z] = bricks.map(|[start, end]| start as usize..end as usize);
        let mut is_prepared = false;
        for z in along_z {
            let layers = zs.map(|at| (at - z as i32 * EDGE).clamp(0, EDGE) as usize);
            for y in along_y.clone() {
                for x in along_x.clone() {
                    let brick = (z * bricks_y + y) * bricks_x + x;
                    let at = BrickAt([x, y, z]);
                    if self.field.brick(brick) == Brick::Empty || !solid.reaches(at) {
                        continue;
                    }
                    if !is_prepared {
                        solid.prepare(self.tables, bricks);
                        is_prepared = true;
                    }
                    self.cut_brick(brick, solid, at, layers);
                }
            }
        }
    }

    /// Cuts a range of layers of a brick.
    #[inline(always)]
    fn cut_brick<S: Solid>(
        &mut self,
        brick: usize,
        solid: &S,
        at: BrickAt,
        [first, end]: [usize; 2],
    ) {
        let Self {
            field,
            tables,
            bands,
            work,
            ..
        } = self;
        let solid = solid.in_brick(tables, at);
        let clay = field.tiles_with_clay(brick);
        bands.clear();
        for layer in first..end.min(BRICK_EDGE) {
            bands.push(layer * 4, solid.bands(layer) & any_of_four(clay[layer]));
        }
        work.clear();
        for &entry in bands.entries() {
            let (layer, band) = (usize::from(entry >> 2) % BRICK_EDGE, usize::from(entry & 3));
            let with_clay = u32::from(clay[layer] >> (4 * band));
            work.push(usize::from(entry) * 4, solid.tiles(layer, band) & with_clay);
        }
        let mut tiles = work.entries();
        let slot = match field.brick(brick) {
            Brick::Empty => return,
            Brick::Slot(slot) => slot,
            Brick::Full => loop {
                let Some((&first, rest)) = tiles.split_first() else {
                    return;
                };
                if !solid.leaves(TileIndex(first)).is_solid() {
                    break field.materialise(brick);
                }
                tiles = rest;
            },
        };
        let voxels = field.slot_mut(slot);
        let mut removed = Removed::nothing();
        for &entry in tiles {
            let at = TileIndex(entry);
            solid.leaves(at).cut(voxels, at.0, &mut removed);
        }
        let removed = removed.sum();
        if 0 < removed {
            field.count_removal(brick, removed);
            self.changes.mark(brick, self.revision);
        }
    }
}

/// Of each four bits in turn, whether any is set.
#[inline(always)]
fn any_of_four(bits: u16) -> u32 {
    let bits = u32::from(bits);
    let pairs = bits | bits >> 1;
    let lowest = (pairs | pairs >> 2) & 0x1111;
    // Brings bits 0, 4, 8 and 12 side by side to 12 and up; no two products meet in a bit.
    (lowest * 0x1248) >> 12 & 0xF
}

#[cfg(test)]
mod tests {
    use super::any_of_four;

    #[test]
    fn fours_of_bits_are_told_apart() {
        for bits in 0..=u16::MAX {
            let want = (0..4).map(|four| u32::from(bits >> (4 * four) & 0xF != 0) << four);
            assert_eq!(any_of_four(bits), want.sum::<u32>(), "{bits:#x}");
        }
    }
}
