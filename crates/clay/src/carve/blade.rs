//! A blade swept along a straight segment: the hull of two boxes.
//!
//! The hull of a box and its copy moved by `m` is bounded by the box's own six planes, each where its box is farther
//! out, and by the planes that contain an edge direction and `m`: normals `e x m`, one for each axis `e`. The distance
//! outside the hull is the greatest of the distances outside these planes, that outside a box the greatest outside its
//! six; a voxel counts by the lesser of hull and the box at the end, which differ only outside the edges of the box.

use super::segment::Segment;
use super::{BrickAt, HALF_UNITS, InBrick, RAMP, SLACK, Solid, Tables, TileIndex, UNITS_PER_VOXEL};
use crate::lanes::{F32x4, LANES, Tile};
use crate::tool::{Blade, ToolShape};

/// The hull in voxel units, voxel centres at whole numbers.
///
/// Where a plane that does not advance decides, the distance is that of the box at the start to the last bit, which is
/// what makes it exact to look only at what the blade pushes ahead of itself.
pub(super) struct BladeSweep {
    axes: [Axis; 3],
    slabs: Slabs,
    /// Distance outside the hull from which on everything is left, and inside it from which on nothing is.
    reach: f32,
    slack: f32,
    /// Distance outside the box at the start up to which nothing is left: that inside it where the box is cut already,
    /// none where it is not.
    clear: f32,
    bounds: [[i32; 2]; 3],
}

/// Hull and boxes along one axis.
#[derive(Clone, Copy)]
struct Axis {
    half: f32,
    /// What to add to a voxel's index to get the way to it from the middle of the box at start and end, and of the
    /// hull.
    from: f32,
    to: f32,
    middle: f32,
    /// The same for the box whose lower, and whose upper plane bounds the hull.
    lower: f32,
    upper: f32,
    step: f32,
}

/// The slab `|normal . w| <= half` about the hull's middle.
#[derive(Clone, Copy, Default)]
struct Slab {
    normal: [f32; 3],
    half: f32,
}

/// The slabs whose planes are askew to the axes: none for a segment along an axis, one for a segment across one, else
/// three.
#[derive(Clone, Copy, Default)]
struct Slabs {
    of: [Slab; 3],
    count: usize,
}

impl BladeSweep {
    /// The box where the segment starts.
    pub(super) fn set_down(blade: &Blade, segment: &Segment) -> Self {
        Self {
            clear: f32::NEG_INFINITY,
            // Less than whatever is ahead, nothing too.
            slack: f32::INFINITY,
            ..Self::new(blade, &segment.at_its_start())
        }
    }

    /// The hull from there to where the segment ends, given that the box where it starts is cut already.
    pub(super) fn new(blade: &Blade, segment: &Segment) -> Self {
        let shape = ToolShape::Blade(*blade);
        let half = shape
            .extents_m()
            .map(|extent_m| 0.5 * extent_m * segment.per_metre);
        let lift = shape
            .middle_from_pose_m()
            .map(|offset_m| offset_m * segment.per_metre);
        let segment = segment.shifted(lift);
        let (step, middle) = (segment.step(), segment.middle());
        let slack = SLACK + 8.0 * segment.rounding;
        let reach = RAMP + slack;
        let axes = std::array::from_fn(|axis| {
            let (from, to) = (-segment.from[axis] as f32, -segment.to[axis] as f32);
            Axis {
                half: half[axis] as f32,
                from,
                to,
                middle: -middle[axis] as f32,
                lower: if step[axis] < 0.0 { to } else { from },
                upper: if 0.0 < step[axis] { to } else { from },
                step: step[axis] as f32,
            }
        });
        Self {
            axes,
            slabs: Slabs::along(step, half),
            reach: reach as f32,
            slack: slack as f32,
            clear: -reach as f32,
            bounds: segment.bounds(half.map(|half| half + reach)),
        }
    }
}

impl Axis {
    /// Distance of places above the upper plane of the box whose middle is at `-offset`.
    #[inline(always)]
    fn above(&self, at: F32x4, offset: f32) -> F32x4 {
        at + F32x4::splat(offset) - F32x4::splat(self.half)
    }

    /// Distance of places below its lower plane.
    #[inline(always)]
    fn below(&self, at: F32x4, offset: f32) -> F32x4 {
        F32x4::splat(0.0) - (at + F32x4::splat(offset)) - F32x4::splat(self.half)
    }

    /// Distance outside the hull's two planes.
    #[inline(always)]
    fn outside_hull(&self, at: F32x4) -> F32x4 {
        self.above(at, self.upper).max(self.below(at, self.lower))
    }

    /// Distance outside the two planes of the box at the end.
    #[inline(always)]
    fn outside_end(&self, at: F32x4) -> F32x4 {
        self.above(at, self.to).max(self.below(at, self.to))
    }

    /// Bounds on distances in runs of places.
    #[inline(always)]
    fn bounds(&self, first: F32x4, last: F32x4) -> Bounds {
        let none = F32x4::splat(f32::MIN);
        let from = self.from;
        let nearest = |upper, lower| self.above(first, upper).max(self.below(last, lower));
        let (ahead, still) = if self.step < 0.0 {
            (self.below(first, from), self.above(first, from))
        } else if 0.0 < self.step {
            (self.above(last, from), self.below(last, from))
        } else {
            (none, nearest(from, from))
        };
        Bounds {
            nearest: nearest(self.upper, self.lower),
            farthest: self.above(last, from).max(self.below(first, from)),
            ahead,
            still,
        }
    }
}

/// Bounds on distances of some places: the least outside the hull; outside the box at the start the greatest, the
/// greatest outside its planes that advance and the least outside those that do not.
#[derive(Clone, Copy)]
struct Bounds {
    nearest: F32x4,
    farthest: F32x4,
    ahead: F32x4,
    still: F32x4,
}

impl Bounds {
    /// Of all places along another axis as well.
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self {
            nearest: self.nearest.max(other.nearest),
            farthest: self.farthest.max(other.farthest),
            ahead: self.ahead.max(other.ahead),
            still: self.still.max(other.still),
        }
    }

    /// Of the places of any lane.
    #[inline(always)]
    fn any(self) -> Self {
        Self {
            nearest: self.nearest.least(),
            farthest: self.farthest.most(),
            ahead: self.ahead.most(),
            still: self.still.least(),
        }
    }

    /// From the tables.
    #[inline(always)]
    fn read(number: impl Fn(usize) -> F32x4) -> Self {
        let [nearest, farthest, ahead, still] = BOUNDS;
        Self {
            nearest: number(nearest),
            farthest: number(farthest),
            ahead: number(ahead),
            still: number(still),
        }
    }
}

impl Slabs {
    /// For each axis the slab whose planes contain its direction and the step, unless they are planes of the boxes.
    fn along(step: [f64; 3], half: [f64; 3]) -> Self {
        let mut slabs = Self::default();
        for axis in 0..3 {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            if step[a].abs() <= 0.0 || step[b].abs() <= 0.0 {
                continue;
            }
            let length = (step[a] * step[a] + step[b] * step[b]).sqrt();
            let (na, nb) = (step[b] / length, -step[a] / length);
            let mut normal = [0.0; 3];
            normal[a] = na as f32;
            normal[b] = nb as f32;
            let half = (na.abs() * half[a] + nb.abs() * half[b]) as f32;
            slabs.of[slabs.count] = Slab { normal, half };
            slabs.count += 1;
        }
        slabs
    }

    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = &Slab> {
        self.of[..self.count.min(3)].iter()
    }
}

/// What is left over at a distance outside a solid. It grows with the distance in spite of rounding, so the greatest or
/// least of several is the same before and after.
#[inline(always)]
fn left_over(distance: F32x4) -> F32x4 {
    F32x4::splat(HALF_UNITS as f32) + F32x4::splat(UNITS_PER_VOXEL as f32) * distance
}

/// Numbers of voxels: what is left over by the distance outside the hull's planes across the axis, and outside those of
/// the box at the end; ways along the normals of three slabs; and along z, where a layer is one voxel thick,
/// [`Bounds`].
const HULL: usize = 0;
const END: usize = 1;
const SLABS: [usize; 3] = [2, 3, 4];
const LAYER_BOUNDS: [usize; 4] = [5, 6, 7, 8];
/// Numbers of fours: [`Bounds`], and ways of their middles along the normals of three slabs.
const BOUNDS: [usize; 4] = [0, 1, 2, 3];
const SLAB_MIDDLES: [usize; 3] = [4, 5, 6];

impl BladeSweep {
    /// Notes bounds of places, each from `first` to `last`.
    #[inline(always)]
    fn bounds_of(&self, axis: usize, of: usize, first: F32x4, last: F32x4) -> F32x4 {
        let bounds = self.axes[axis].bounds(first, last);
        [bounds.nearest, bounds.farthest, bounds.ahead, bounds.still][of]
    }

    /// Ways along a slab's normal that places along an axis make.
    #[inline(always)]
    fn along(&self, slab: &Slab, axis: usize, at: F32x4) -> F32x4 {
        (at + F32x4::splat(self.axes[axis].middle)) * F32x4::splat(slab.normal[axis])
    }

    fn prepare_askew(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]) {
        let half = F32x4::splat(0.5 * (LANES - 1) as f32);
        for axis in 0..3 {
            tables.note_voxels(axis, END, bricks[axis], |first| {
                left_over(self.axes[axis].outside_end(F32x4::stepping(first, 1)))
            });
            for (slab, (number, middles)) in
                self.slabs.iter().zip(SLABS.into_iter().zip(SLAB_MIDDLES))
            {
                tables.note_voxels(axis, number, bricks[axis], |first| {
                    self.along(slab, axis, F32x4::stepping(first, 1))
                });
                tables.note_fours(axis, middles, bricks[axis], |first| {
                    self.along(slab, axis, F32x4::stepping(first, LANES as i32) + half)
                });
            }
        }
    }
}

impl Solid for BladeSweep {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline(always)]
    fn prepare(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]) {
        for axis in 0..3 {
            tables.note_voxels(axis, HULL, bricks[axis], |first| {
                left_over(self.axes[axis].outside_hull(F32x4::stepping(first, 1)))
            });
        }
        for number in BOUNDS {
            for axis in 0..2 {
                tables.note_fours(axis, number, bricks[axis], |first| {
                    let [first, last] = [first, first + LANES as i32 - 1]
                        .map(|at| F32x4::stepping(at, LANES as i32));
                    self.bounds_of(axis, number, first, last)
                });
            }
            tables.note_voxels(2, LAYER_BOUNDS[number], bricks[2], |first| {
                let at = F32x4::stepping(first, 1);
                self.bounds_of(2, number, at, at)
            });
        }
        if 0 < self.slabs.count {
            self.prepare_askew(tables, bricks);
        }
    }

    fn reaches(&self, _at: BrickAt) -> bool {
        true
    }

    #[inline(always)]
    fn in_brick<'a>(&'a self, tables: &'a Tables, at: BrickAt) -> impl InBrick + 'a {
        let [tiles, bands] =
            [0, 1].map(|axis| Bounds::read(|number| tables.fours(axis, number, at)));
        // A voxel within reach of a box's planes may be this much farther from a plane through its edge.
        let corner = std::f32::consts::SQRT_2 * self.reach;
        let half = 0.5 * (LANES - 1) as f32;
        BladeInBrick {
            tables,
            at,
            tiles,
            any_tile: bands.and(tiles.any()),
            slabs: self.slabs.of.map(|slab| {
                let [x, y, _] = slab.normal;
                let reach = slab.half + corner + half * (x.abs() + y.abs());
                [slab.half, reach].map(F32x4::splat)
            }),
            slab_count: self.slabs.count,
            reach: F32x4::splat(self.reach),
            clear: F32x4::splat(self.clear),
            slack: F32x4::splat(self.slack),
        }
    }
}

/// The hull in one brick. The distance outside several planes is the greatest of the distances, each a matter of one
/// axis, but for the planes askew.
struct BladeInBrick<'a> {
    tables: &'a Tables,
    at: BrickAt,
    tiles: Bounds,
    /// Of bands, together with the extremes over all tiles.
    any_tile: Bounds,
    /// Of each slab, half its thickness, and how far a tile's middle may be from its middle for anything in the tile to
    /// change.
    slabs: [[F32x4; 2]; 3],
    slab_count: usize,
    reach: F32x4,
    clear: F32x4,
    slack: F32x4,
}

impl BladeInBrick<'_> {
    /// Within reach of the hull, not wholly where nothing is left, and not wholly where a plane that does not advance
    /// is the farthest seen from the box at the start: there nothing changes.
    #[inline(always)]
    fn may_change(&self, layer: usize, bounds: Bounds) -> u32 {
        let of_layer = |number: usize| self.tables.layer(LAYER_BOUNDS[number], self.at, layer);
        let bounds = bounds.and(Bounds::read(of_layer));
        let near = bounds.nearest.is_below(self.reach);
        let left = self.clear.is_below(bounds.farthest);
        let ahead = (bounds.still - self.slack).is_below(bounds.ahead);
        near.and(left).and(ahead).bits()
    }

    /// What is left over by the planes of the hull, or of the box at the end.
    #[inline(always)]
    fn by_planes(&self, number: usize, tile: TileIndex) -> [F32x4; LANES] {
        let along = self.tables.four_voxels(0, number, self.at, tile.tile());
        let bands = self.tables.four_voxels(1, number, self.at, tile.band());
        let across = bands.max(self.tables.layer(number, self.at, tile.layer()));
        let [a, b, c, d] = across.each_splatted();
        [along.max(a), along.max(b), along.max(c), along.max(d)]
    }
}

impl InBrick for BladeInBrick<'_> {
    #[inline(always)]
    fn bands(&self, layer: usize) -> u32 {
        self.may_change(layer, self.any_tile)
    }

    #[inline(always)]
    fn tiles(&self, layer: usize, band: usize) -> u32 {
        let bands = Bounds::read(|number| self.tables.band(number, self.at, band));
        let mut tiles = self.may_change(layer, self.tiles.and(bands));
        for (slab, [_, reach]) in self.slabs[..self.slab_count].iter().enumerate() {
            let along = self.tables.fours(0, SLAB_MIDDLES[slab], self.at)
                + (self.tables.band(SLAB_MIDDLES[slab], self.at, band)
                    + self.tables.layer(SLABS[slab], self.at, layer));
            tiles &= along.abs().is_below(*reach).bits();
        }
        tiles
    }

    #[inline(always)]
    fn leaves(&self, tile: TileIndex) -> Tile {
        let mut hull = self.by_planes(HULL, tile);
        if self.slab_count == 0 {
            return Tile::nearest(hull);
        }
        for (slab, [half, _]) in self.slabs[..self.slab_count].iter().enumerate() {
            let along = self
                .tables
                .four_voxels(0, SLABS[slab], self.at, tile.tile());
            let across = self
                .tables
                .four_voxels(1, SLABS[slab], self.at, tile.band())
                + self.tables.layer(SLABS[slab], self.at, tile.layer());
            for (hull, across) in hull.iter_mut().zip(across.each_splatted()) {
                *hull = hull.max(left_over((along + across).abs() - *half));
            }
        }
        // The hull lies about the box at the end, but for rounding and outside its edges.
        let end = self.by_planes(END, tile);
        Tile::nearest(std::array::from_fn(|row| hull[row].min(end[row])))
    }
}
