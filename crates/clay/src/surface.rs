//! The clay's surface as a closed mesh, by surface nets.
//!
//! Every cell between eight voxel centres that are not all clay or all air gets one vertex, in the mean of the places where its
//! edges pass half occupancy. Every edge between clay and air gets a quadrilateral of the four cells about it. Beyond the grid there
//! is air, so the mesh closes around the block.
//!
//! Each side of a quadrilateral runs through the face between two cells. Along the four edges of that face clay and air change an even number of
//! times, as often one way as the other, so every directed side meets its opposite: the mesh has no boundary.
//!
//! Only cells near bricks that are neither all air nor all clay together with their neighbours are visited.

use crate::clay::Clay;
use crate::field::{BrickView, SOLID};
use crate::grid::{BRICK_EDGE, BRICK_VOXELS};

/// Occupancy from which on a voxel counts as clay; the surface is at half of solid.
const CLAY_FROM: u8 = SOLID / 2 + 1;
const HALF: f32 = SOLID as f32 / 2.0;
/// Samples along the edge of a brick's cells: one more than cells.
const SAMPLES: usize = BRICK_EDGE + 1;

/// A triangle mesh in the clay frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, m.
    pub positions_m: Vec<[f32; 3]>,
    /// Vertex numbers of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The surface of the clay. Empty for clay that is all gone.
    #[must_use]
    pub fn of(clay: &Clay) -> Self {
        Surfacer::new(clay).surface()
    }

    /// Volume that the mesh encloses, m³, by the divergence theorem.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        let six_volumes: f64 = self
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|at| self.positions_m[at as usize].map(f64::from));
                a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
            })
            .sum();
        six_volumes / 6.0
    }
}

/// Occupancies of the voxels whose cells belong to a brick: the brick's own, and one more layer along each axis.
type Samples = [u8; SAMPLES * SAMPLES * SAMPLES];

/// The cells of a brick that have vertices. Bricks of cells begin one before the grid, for the air around it.
struct CellBrick {
    /// Where the brick's cells begin, in bricks; -1 for those before the grid.
    at: [i32; 3],
    /// A bit for each cell with a vertex, and before each word the number of the word's first vertex.
    cells: [u64; BRICK_VOXELS / 64],
    first_vertices: [u32; BRICK_VOXELS / 64],
}

struct Surfacer<'a> {
    clay: &'a Clay,
    /// Bricks of cells along x, y, z.
    counts: [usize; 3],
    bricks: Vec<Option<Box<CellBrick>>>,
    mesh: Mesh,
}

impl<'a> Surfacer<'a> {
    fn new(clay: &'a Clay) -> Self {
        let counts = clay.grid().bricks().map(|count| usize::from(count) + 1);
        Self {
            clay,
            counts,
            bricks: Vec::new(),
            mesh: Mesh::default(),
        }
    }

    fn surface(mut self) -> Mesh {
        let mut samples = [0; SAMPLES * SAMPLES * SAMPLES];
        for place in 0..self.counts.iter().product() {
            let at = self.brick_at(place);
            let brick = self
                .gather(at, &mut samples)
                .then(|| self.place_vertices(at, &samples));
            self.bricks.push(brick);
        }
        for place in 0..self.bricks.len() {
            let Some(at) = self.bricks[place].as_ref().map(|brick| brick.at) else {
                continue;
            };
            self.gather(at, &mut samples);
            self.join_vertices(at, &samples);
        }
        self.mesh
    }

    fn brick_at(&self, place: usize) -> [i32; 3] {
        let [x, y, _] = self.counts;
        [place % x, place / x % y, place / x / y].map(|at| at as i32 - 1)
    }

    /// Fetches the samples of a brick of cells; `false` if they are all air or all clay.
    fn gather(&self, at: [i32; 3], samples: &mut Samples) -> bool {
        let views: [BrickView<'_>; 8] = std::array::from_fn(|corner| {
            let brick = [0, 1, 2].map(|axis| u16::try_from(at[axis] + (corner >> axis & 1) as i32));
            match brick {
                [Ok(x), Ok(y), Ok(z)] => {
                    let index = self.clay.grid().brick_at([x, y, z]);
                    index.map_or(BrickView::Empty, |index| self.clay.brick(index))
                }
                _ => BrickView::Empty,
            }
        });
        let uniform = !matches!(views[0], BrickView::Voxels(_));
        if uniform && views.iter().all(|view| *view == views[0]) {
            return false;
        }
        for (number, sample) in samples.iter_mut().enumerate() {
            let [x, y, z] = places(number, SAMPLES);
            let corner = x / BRICK_EDGE + y / BRICK_EDGE * 2 + z / BRICK_EDGE * 4;
            *sample = match views[corner] {
                BrickView::Empty => 0,
                BrickView::Full => SOLID,
                BrickView::Voxels(voxels) => {
                    voxels[number_of([x, y, z].map(|at| at % BRICK_EDGE), BRICK_EDGE)]
                }
            };
        }
        true
    }

    /// Gives vertices to the cells through which the surface runs.
    fn place_vertices(&mut self, at: [i32; 3], samples: &Samples) -> Box<CellBrick> {
        let mut brick = Box::new(CellBrick {
            at,
            cells: [0; BRICK_VOXELS / 64],
            first_vertices: [0; BRICK_VOXELS / 64],
        });
        let voxel_size_m = self.clay.grid().voxel_size_m();
        for cell in 0..BRICK_VOXELS {
            if cell % 64 == 0 {
                brick.first_vertices[cell / 64] = self.mesh.positions_m.len() as u32;
            }
            let place = places(cell, BRICK_EDGE);
            let Some(in_cell) = vertex_in_cell(&corners(samples, place)) else {
                continue;
            };
            brick.cells[cell / 64] |= 1 << (cell % 64);
            self.mesh.positions_m.push(std::array::from_fn(|axis| {
                let voxel = at[axis] * BRICK_EDGE as i32 + place[axis] as i32;
                ((f64::from(voxel) + f64::from(in_cell[axis]) + 0.5) * voxel_size_m) as f32
            }));
        }
        brick
    }

    /// Joins the four vertices about each edge between clay and air.
    fn join_vertices(&mut self, at: [i32; 3], samples: &Samples) {
        for cell in 0..BRICK_VOXELS {
            let place = places(cell, BRICK_EDGE);
            let here = CLAY_FROM <= samples[number_of(place, SAMPLES)];
            for axis in 0..3 {
                let mut next = place;
                next[axis] += 1;
                let there = CLAY_FROM <= samples[number_of(next, SAMPLES)];
                if here == there {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let voxel: [i32; 3] =
                    std::array::from_fn(|axis| at[axis] * BRICK_EDGE as i32 + place[axis] as i32);
                let vertex = |back_u: i32, back_v: i32| {
                    let mut cell = voxel;
                    cell[u] -= back_u;
                    cell[v] -= back_v;
                    self.vertex_of(cell)
                };
                // Counter-clockwise about the axis, which points from clay to air or the other way.
                let [a, b, c, d] = [vertex(1, 1), vertex(0, 1), vertex(0, 0), vertex(1, 0)];
                let triangles = if here {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, c, b], [a, d, c]]
                };
                self.mesh.triangles.extend(triangles);
            }
        }
    }

    /// The vertex of the cell whose lowest corner is this voxel. It has one, as an edge about it changes between clay and air.
    fn vertex_of(&self, voxel: [i32; 3]) -> u32 {
        let edge = BRICK_EDGE as i32;
        let [x, y, z] = voxel.map(|at| (at.div_euclid(edge) + 1) as usize);
        let place = (z * self.counts[1] + y) * self.counts[0] + x;
        let brick = self.bricks[place]
            .as_ref()
            .expect("a cell with a changing edge has a brick");
        let cell = number_of(voxel.map(|at| at.rem_euclid(edge) as usize), BRICK_EDGE);
        let before = brick.cells[cell / 64] & ((1 << (cell % 64)) - 1);
        brick.first_vertices[cell / 64] + before.count_ones()
    }
}

/// The place of a numbered cell or sample along x, y, z.
const fn places(number: usize, edge: usize) -> [usize; 3] {
    [number % edge, number / edge % edge, number / edge / edge]
}

const fn number_of([x, y, z]: [usize; 3], edge: usize) -> usize {
    (z * edge + y) * edge + x
}

/// Occupancies at the corners of a cell: x fastest, then y, then z.
fn corners(samples: &Samples, [x, y, z]: [usize; 3]) -> [u8; 8] {
    std::array::from_fn(|corner| {
        let place = [x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)];
        samples[number_of(place, SAMPLES)]
    })
}

/// Mean of the places, from 0 to 1 along x, y, z, where the edges of a cell pass half occupancy.
fn vertex_in_cell(corners: &[u8; 8]) -> Option<[f32; 3]> {
    let clay = corners
        .iter()
        .filter(|&&corner| CLAY_FROM <= corner)
        .count();
    if clay == 0 || clay == corners.len() {
        return None;
    }
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for axis in 0..3 {
        for start in (0..8).filter(|corner| corner >> axis & 1 == 0) {
            let (a, b) = (corners[start], corners[start | 1 << axis]);
            if (CLAY_FROM <= a) == (CLAY_FROM <= b) {
                continue;
            }
            let (a, b) = (f32::from(a), f32::from(b));
            let along = (HALF - a) / (b - a);
            for (at, total) in sum.iter_mut().enumerate() {
                *total += if at == axis {
                    along
                } else {
                    (start >> at & 1) as f32
                };
            }
            count += 1.0;
        }
    }
    Some(sum.map(|total| total / count))
}
