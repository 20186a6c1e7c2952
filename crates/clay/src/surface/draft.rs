//! The surface while its vertices can still move within their cells: loops and the quadrilaterals about crossings.

use std::collections::BTreeMap;

use crate::clay::Clay;
use crate::grid::{BRICK_EDGE, BrickIndex, Grid};

use super::Mesh;
use super::cell::{Vertex, edge_number};
use super::window::{CELLS, CELLS_IN_ALL, HALO, NO_VERTEX, Window};

/// Cells that are the last along an axis in a brick.
const SEAM_CELLS: usize = BRICK_EDGE * BRICK_EDGE;

/// Vertices, and quadrilaterals between them.
#[derive(Default)]
pub(super) struct Draft {
    vertices: Vec<Vertex>,
    /// About edges along each axis: corners, counter-clockwise seen from outside.
    quads: [Vec<[u32; 4]>; 3],
}

/// Vertices of the cells between bricks, which more bricks than one come upon.
pub(super) struct Seams {
    /// Bricks along x, y, z, with one more before each first one: the air there has cells, too.
    counts: [usize; 3],
    /// For each brick the cells that are its last along x, then along y, then along z: first loops.
    bricks: Vec<Option<Box<[u32; 3 * SEAM_CELLS]>>>,
    /// Further loops of the few cells that have more than one.
    further: BTreeMap<([i16; 3], u8), u32>,
}

/// How large a surface is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// Enclosed, voxels.
    pub(super) volume: f64,
    /// Faces of voxels.
    pub(super) area: f64,
}

impl Draft {
    /// The whole surface, when voxels count as clay from an occupancy on.
    pub(super) fn of(clay: &Clay, clay_from: u8) -> Self {
        let mut draft = Self::default();
        let mut seams = Seams::new(clay.grid());
        let mut window = Window::empty();
        for index in bricks(clay) {
            let at = clay.grid().brick_coordinates(index);
            if window.look_at(clay, at, clay_from) {
                draft.add(&mut window, Some(&mut seams), at, [0; 3]);
            }
        }
        draft
    }

    /// The part of the surface that belongs to a brick.
    pub(super) fn of_brick(clay: &Clay, index: BrickIndex, clay_from: u8) -> Self {
        let mut draft = Self::default();
        let mut window = Window::empty();
        let at = clay.grid().brick_coordinates(index);
        if window.look_at(clay, at, clay_from) {
            draft.add(&mut window, None, at, [0; 3]);
        }
        draft
    }

    /// Forgets everything, and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.vertices.clear();
        self.quads.iter_mut().for_each(Vec::clear);
    }

    pub(super) fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// Adds what belongs to the brick at these coordinates, which the window shows: all but the layers of edges along
    /// each axis that are left out, a bit for each by their first voxels' place in the window.
    pub(super) fn add(
        &mut self,
        window: &mut Window,
        mut seams: Option<&mut Seams>,
        at: [u16; 3],
        left_out: [u32; 3],
    ) {
        window.vertices.fill(NO_VERTEX);
        let lowest = lowest_edges(at);
        for axis in 0..3 {
            // Where the grid begins, the edges from the air before it are this brick's, too.
            let mut from = [HALO; 3];
            from[axis] = lowest[axis];
            let is_left_out =
                |along: usize, place: usize| axis == along && left_out[axis] >> place & 1 == 1;
            let mut columns = bits(from[0], HALO + BRICK_EDGE);
            if axis == 0 {
                columns &= !left_out[0];
            }
            for z in (from[2]..HALO + BRICK_EDGE).filter(|&z| !is_left_out(2, z)) {
                for y in (from[1]..HALO + BRICK_EDGE).filter(|&y| !is_left_out(1, y)) {
                    let here = window.clay[z][y];
                    let there = match axis {
                        0 => here >> 1,
                        1 => window.clay[z][y + 1],
                        _ => window.clay[z + 1][y],
                    };
                    let mut changes = (here ^ there) & columns;
                    while changes != 0 {
                        let x = changes.trailing_zeros() as usize;
                        changes &= changes - 1;
                        self.add_quad(window, seams.as_deref_mut(), [x, y, z], axis);
                    }
                }
            }
        }
    }

    /// The quadrilateral about the edge from a voxel to the next one along an axis.
    pub(super) fn add_quad(
        &mut self,
        window: &mut Window,
        mut seams: Option<&mut Seams>,
        voxel: [usize; 3],
        axis: usize,
    ) {
        let mut corner = |back_next: usize, back_last: usize| {
            let mut cell = voxel;
            cell[(axis + 1) % 3] -= back_next;
            cell[(axis + 2) % 3] -= back_last;
            let edge = edge_number(axis, back_next, back_last);
            self.vertex(window, seams.as_deref_mut(), cell, edge)
        };
        // Counter-clockwise about the axis, which points from clay to air or the other way.
        let [a, b, c, d] = [corner(1, 1), corner(0, 1), corner(0, 0), corner(1, 0)];
        let [x, y, z] = voxel;
        self.quads[axis].push(if window.clay[z][y] >> x & 1 == 1 {
            [a, b, c, d]
        } else {
            [a, d, c, b]
        });
    }

    /// The vertex of a cell's loop through one of its edges.
    pub(super) fn vertex(
        &mut self,
        window: &mut Window,
        seams: Option<&mut Seams>,
        cell: [usize; 3],
        edge: usize,
    ) -> u32 {
        let corners = window.corners(cell);
        let loops = window.loops(cell, corners);
        let number = loops.through(edge);
        let [x, y, z] = cell.map(|at| at + 1 - HALO);
        let place = usize::from(number) * CELLS_IN_ALL + (z * CELLS + y) * CELLS + x;
        let known = window.vertices[place];
        if known != NO_VERTEX {
            return known;
        }
        let voxel =
            std::array::from_fn(|axis| window.first[axis] + cell[axis] as i16 - HALO as i16);
        let next = self.vertices.len() as u32;
        let is_last = |at: &usize| at.is_multiple_of(BRICK_EDGE);
        let vertex = match seams {
            Some(seams) if [x, y, z].iter().any(is_last) => seams.known_or(voxel, number, next),
            _ => next,
        };
        if vertex == next {
            let occupancies = window.occupancies_at(cell);
            self.vertices
                .push(Vertex::new(voxel, &occupancies, corners, loops, number));
        }
        window.vertices[place] = vertex;
        vertex
    }

    /// How large the surface is when its vertices are shifted outwards by so many voxels.
    pub(super) fn extent(&self, shift: f32, places: &mut Vec<[f32; 3]>) -> Extent {
        self.place(shift, places);
        let (mut six_volumes, mut two_areas) = (0.0, 0.0);
        for triangle in self.triangles(places) {
            let [a, b, c] = triangle.map(|at| places[at as usize].map(f64::from));
            let normal = cross(sub(b, a), sub(c, a));
            six_volumes += dot(a, normal);
            two_areas += dot(normal, normal).sqrt();
        }
        Extent {
            volume: six_volumes / 6.0,
            area: two_areas / 2.0,
        }
    }

    /// The mesh, its vertices shifted outwards by so many voxels.
    pub(super) fn finish(&self, voxel_size_m: f64, shift: f32) -> Mesh {
        let mut places = Vec::new();
        self.place(shift, &mut places);
        let mut triangles = Vec::with_capacity(2 * self.quads.iter().map(Vec::len).sum::<usize>());
        triangles.extend(self.triangles(&places));
        let positions = self.vertices.iter().map(|vertex| {
            let within = vertex.within(shift);
            std::array::from_fn(|axis| {
                let centre = f64::from(vertex.cell[axis]) + 0.5;
                ((centre + f64::from(within[axis])) * voxel_size_m) as f32
            })
        });
        Mesh {
            positions_m: positions.collect(),
            triangles,
        }
    }

    /// Places of all vertices, in voxels from the centre of the grid's first one.
    pub(super) fn place(&self, shift: f32, places: &mut Vec<[f32; 3]>) {
        places.clear();
        places.extend(self.vertices.iter().map(|vertex| {
            let within = vertex.within(shift);
            std::array::from_fn(|axis| f32::from(vertex.cell[axis]) + within[axis])
        }));
    }

    pub(super) fn triangles(&self, places: &[[f32; 3]]) -> impl Iterator<Item = [u32; 3]> {
        (0..3).flat_map(move |axis| {
            let quads = self.quads[axis].iter();
            quads.flat_map(move |quad| halved(*quad, axis, places))
        })
    }
}

/// Cuts a quadrilateral about an edge along an axis into two triangles: along the first diagonal, unless the second one
/// makes the lesser triangle twice as large, as seen along the axis.
#[inline(always)]
fn halved([a, b, c, d]: [u32; 4], axis: usize, places: &[[f32; 3]]) -> [[u32; 3]; 2] {
    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
    let [p, q, r, s] = [a, b, c, d].map(|at| {
        let place = places[at as usize];
        [place[next], place[last]]
    });
    let area = |p: [f32; 2], q: [f32; 2], r: [f32; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    let first = [area(p, q, r), area(p, r, s)];
    let second = [area(p, q, s), area(q, r, s)];
    // Above zero where the quadrilateral faces along the axis.
    let way = (first[0] + first[1]).signum();
    let least = |areas: [f32; 2]| (way * areas[0]).min(way * areas[1]);
    if 2.0 * least(first) < least(second) {
        [[a, b, d], [b, c, d]]
    } else {
        [[a, b, c], [a, c, d]]
    }
}

impl Seams {
    fn new(grid: &Grid) -> Self {
        let counts = grid.bricks().map(|count| usize::from(count) + 1);
        let mut bricks = Vec::new();
        bricks.resize_with(counts.iter().product(), || None);
        Self {
            counts,
            bricks,
            further: BTreeMap::new(),
        }
    }

    /// The vertex of a loop of a cell that is the last along some axis in its brick; `new` if it has none yet.
    fn known_or(&mut self, cell: [i16; 3], number: u8, new: u32) -> u32 {
        if number != 0 {
            return *self.further.entry((cell, number)).or_insert(new);
        }
        // Counted from one brick before the grid.
        let at = cell.map(|at| (at + BRICK_EDGE as i16) as usize);
        let [x, y, z] = at.map(|at| at / BRICK_EDGE);
        let at = at.map(|at| at % BRICK_EDGE);
        let brick = &mut self.bricks[(z * self.counts[1] + y) * self.counts[0] + x];
        let brick = brick.get_or_insert_with(|| Box::new([NO_VERTEX; 3 * SEAM_CELLS]));
        let axis = (0..3)
            .find(|&axis| at[axis] == BRICK_EDGE - 1)
            .expect("the cell is the last along some axis");
        let (next, last) = (at[(axis + 1) % 3], at[(axis + 2) % 3]);
        let known = &mut brick[axis * SEAM_CELLS + last * BRICK_EDGE + next];
        if *known == NO_VERTEX {
            *known = new;
        }
        *known
    }
}

fn bricks(clay: &Clay) -> impl Iterator<Item = BrickIndex> {
    let grid = *clay.grid();
    (0..grid.brick_count() as u32).filter_map(move |dense| grid.brick_index(dense))
}

/// Where in a window the edges along each axis that belong to the brick at these coordinates begin: one before the
/// brick where the grid begins, as those from the air before it are the brick's, too.
pub(super) fn lowest_edges(at: [u16; 3]) -> [usize; 3] {
    at.map(|at| HALO - usize::from(at == 0))
}

/// A word with the bits from one up to, and without, another.
const fn bits(from: usize, until: usize) -> u32 {
    (1 << until) - (1 << from)
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::MARGIN;
    use proptest::prelude::*;

    /// Somewhere in a cell, and rather often as near to a side as a vertex may go.
    fn within() -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(prop_oneof![
            Just(MARGIN),
            Just(1.0 - MARGIN),
            Just(0.5 + MARGIN),
            MARGIN..1.0 - MARGIN,
        ])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        /// Wherever in their cells the corners of a quadrilateral lie, both halves of it face along the edge, also when
        /// coordinates have been rounded to millimetres at the far end of the largest grid.
        #[test]
        fn both_halves_of_a_quadrilateral_face_along_its_edge(
            axis in 0..3_usize,
            corners in prop::array::uniform4(within()),
            first in 0..4_usize,
            voxel_mm in 0.01_f32..100.0,
        ) {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut places = corners.map(|within| within.map(|at| 510.0 + at));
            for (corner, [along_next, along_last]) in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].into_iter().enumerate() {
                places[corner][next] += along_next;
                places[corner][last] += along_last;
            }
            let around: [u32; 4] = std::array::from_fn(|corner| ((first + corner) % 4) as u32);
            let [a, b, c, d] = around;
            for (quad, way) in [([a, b, c, d], 1.0), ([a, d, c, b], -1.0)] {
                for triangle in halved(quad, axis, &places) {
                    let [p, q, r] = triangle.map(|at| places[at as usize].map(|at| f64::from(at * voxel_mm)));
                    let area = (q[next] - p[next]) * (r[last] - p[last]) - (q[last] - p[last]) * (r[next] - p[next]);
                    prop_assert!(0.0 < way * area, "{quad:?} {places:?}");
                }
            }
        }
    }
}
