//! A mesh where it stands: what is left over by the distances of its lattice.
//!
//! A sweep is cut as the mesh at places on the way, no farther than [`STRIDE`] of a voxel apart, the last at its end.
//! Between two of them a corner that moves across itself leaves at most half of that unmet, an eighth of a voxel.

use super::ball::Centre;
use super::segment::Segment;
use super::{BrickAt, HALF_UNITS, InBrick, RAMP, SLACK, Solid, Tables, TileIndex, UNITS_PER_VOXEL};
use crate::bake::Baked;
use crate::lanes::{F32x4, LANES, Tile};

/// From the middle of a tile, and of a brick, to the farthest of its voxels, in voxels.
const TILE_RADIUS: f64 = 1.5 * std::f64::consts::SQRT_2;
const BRICK_RADIUS: f64 = 7.5 * 1.732_050_807_568_877_2;
/// Between places at which a sweep is cut, in voxels.
const STRIDE: f64 = 0.25;
/// By how much a distance between nodes may be off, in cells.
const CELL_SLACK: f64 = 0.5;

/// A mesh at a place.
pub(super) struct MeshAt<'a> {
    baked: &'a Baked,
    place: Centre,
    /// From units of what is left over to cells, and back.
    cells_per_unit: f32,
    units_per_cell: f32,
    /// The tool's position in the lattice.
    position: [f32; 3],
    reach: f32,
    brick_reach: f32,
    bounds: [[i32; 2]; 3],
}

/// Places along a segment at which a mesh is cut, from the one after its start to its end.
pub(super) fn places(segment: &Segment) -> impl Iterator<Item = [f64; 3]> + use<> {
    let (to, step) = (segment.to, segment.step());
    // No grid is longer than this many strides.
    let count = (segment.length_squared().sqrt() / STRIDE)
        .ceil()
        .clamp(1.0, 1e6) as u32;
    (0..count).rev().map(move |left| {
        // From the end backwards, so that the last place is the end to the last bit.
        let share = f64::from(left) / f64::from(count);
        std::array::from_fn(|axis| to[axis] - share * step[axis])
    })
}

impl<'a> MeshAt<'a> {
    pub(super) fn new(baked: &'a Baked, place: [f64; 3], per_metre: f64) -> Self {
        let cell = baked.cell_m * per_metre;
        let reach = RAMP + SLACK + CELL_SLACK * cell;
        let [least, most] = baked.bounds_m;
        let bounds = std::array::from_fn(|axis| {
            let [first, _] = Segment::voxels_about(place[axis] + least[axis] * per_metre, reach);
            let [_, end] = Segment::voxels_about(place[axis] + most[axis] * per_metre, reach);
            [first, end]
        });
        Self {
            baked,
            place: Centre::of(place),
            cells_per_unit: (1.0 / (cell * UNITS_PER_VOXEL)) as f32,
            units_per_cell: (cell * UNITS_PER_VOXEL) as f32,
            position: baked
                .first_m
                .map(|first_m| (-first_m / baked.cell_m) as f32),
            reach: ((reach + TILE_RADIUS) * UNITS_PER_VOXEL) as f32,
            brick_reach: ((reach + BRICK_RADIUS) * UNITS_PER_VOXEL) as f32,
            bounds,
        }
    }

    /// Distance outside the mesh, in units. Beyond the lattice, that at its border and the way from there.
    #[inline(always)]
    fn outside(&self, way: [F32x4; 3]) -> F32x4 {
        let nodes = self.baked.nodes;
        let (zero, half) = (F32x4::splat(0.0), F32x4::splat(0.5));
        let at = |axis: usize| {
            way[axis] * F32x4::splat(self.cells_per_unit) + F32x4::splat(self.position[axis])
        };
        let mut beyond_squared = zero;
        let mut cells = [[0_usize; LANES]; 3];
        let mut shares = [zero; 3];
        for axis in 0..3 {
            let at = at(axis);
            let kept = at.max(zero).min(F32x4::splat((nodes[axis] - 1) as f32));
            let beyond = at - kept;
            beyond_squared = beyond_squared + beyond * beyond;
            let cell = (kept - half).nearest_within([0.0, (nodes[axis] - 2) as f32]);
            shares[axis] = kept - cell.to_f32();
            cells[axis] = cell.to_array().map(|cell| cell as usize);
        }
        let [x, y, z] = shares;
        let corner = |dx: usize, dy: usize, dz: usize| {
            F32x4::load(&std::array::from_fn(|lane| {
                let node = ((cells[2][lane] + dz) * nodes[1] + cells[1][lane] + dy) * nodes[0]
                    + cells[0][lane]
                    + dx;
                self.baked.distance[node]
            }))
        };
        let between = |a: F32x4, b: F32x4, share: F32x4| a + (b - a) * share;
        let along_x = |dy: usize, dz: usize| between(corner(0, dy, dz), corner(1, dy, dz), x);
        let along_y = |dz: usize| between(along_x(0, dz), along_x(1, dz), y);
        let distance = between(along_y(0), along_y(1), z) + beyond_squared.sqrt();
        distance * F32x4::splat(self.units_per_cell)
    }
}

/// Number of voxels: ways from the tool's position. Number of fours: those of their middles.
const WAY: usize = 0;
const MIDDLE: usize = 0;

impl Solid for MeshAt<'_> {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline(always)]
    fn prepare(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]) {
        self.place.note_ways(tables, bricks, [WAY, MIDDLE]);
    }

    fn reaches(&self, at: BrickAt) -> bool {
        let middle = self.place.way_to_middle(at);
        let near = self
            .outside(middle)
            .is_below(F32x4::splat(self.brick_reach));
        near.bits() != 0
    }

    #[inline(always)]
    fn in_brick<'a>(&'a self, tables: &'a Tables, at: BrickAt) -> impl InBrick + 'a {
        MeshInBrick {
            mesh: self,
            tables,
            at,
        }
    }
}

/// The mesh in one brick.
struct MeshInBrick<'a> {
    mesh: &'a MeshAt<'a>,
    tables: &'a Tables,
    at: BrickAt,
}

impl InBrick for MeshInBrick<'_> {
    #[inline(always)]
    fn bands(&self, _layer: usize) -> u32 {
        0xF
    }

    #[inline(always)]
    fn tiles(&self, layer: usize, band: usize) -> u32 {
        let distance = self.mesh.outside([
            self.tables.fours(0, MIDDLE, self.at),
            self.tables.band(MIDDLE, self.at, band),
            self.tables.layer(WAY, self.at, layer),
        ]);
        distance.is_below(F32x4::splat(self.mesh.reach)).bits()
    }

    #[inline(always)]
    fn leaves(&self, tile: TileIndex) -> Tile {
        let x = self.tables.four_voxels(0, WAY, self.at, tile.tile());
        let y = self
            .tables
            .four_voxels(1, WAY, self.at, tile.band())
            .each_splatted();
        let z = self.tables.layer(WAY, self.at, tile.layer());
        let at_surface = F32x4::splat(HALF_UNITS as f32);
        Tile::nearest(std::array::from_fn(|row| {
            at_surface + self.mesh.outside([x, y[row], z])
        }))
    }
}
