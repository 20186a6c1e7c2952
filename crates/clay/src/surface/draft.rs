//! The surface while its vertices can still move within their cells: loops and the quadrilaterals about crossings.

use std::collections::BTreeMap;

use crate::clay::Clay;
use crate::field::{BrickView, SOLID};
use crate::grid::{BRICK_EDGE, BrickIndex, Grid};

use super::Mesh;
use super::cell::{Configuration, Corners, Loops, MOST_LOOPS, Vertex, edge_number};

/// Layers of voxels around a brick: its cells reach one beyond it, and what is across their faces another one.
const HALO: usize = 2;
/// Voxels along an edge of a brick with its halo.
const EDGE: usize = BRICK_EDGE + 2 * HALO;
/// Cells along an edge of a brick: one more than voxels, as they lie between them.
const CELLS: usize = BRICK_EDGE + 1;
const CELLS_IN_ALL: usize = CELLS * CELLS * CELLS;
/// Cells that are the last along an axis in a brick.
const SEAM_CELLS: usize = BRICK_EDGE * BRICK_EDGE;
/// Of a loop that has no vertex yet.
const NO_VERTEX: u32 = u32::MAX;

/// Vertices, and quadrilaterals between them.
#[derive(Default)]
pub(super) struct Draft {
    vertices: Vec<Vertex>,
    /// About edges along each axis: corners, counter-clockwise seen from outside.
    quads: [Vec<[u32; 4]>; 3],
}

/// Vertices of the cells between bricks, which more bricks than one come upon.
struct Seams {
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

/// A brick with its halo.
struct Window {
    /// The brick's first voxel.
    first: [i16; 3],
    occupancies: Box<[[[u8; EDGE]; EDGE]; EDGE]>,
    /// Which of them count as clay: a bit for each voxel along x.
    clay: Box<[[u32; EDGE]; EDGE]>,
    /// Vertices of the cells' first loops, then of their second ones, and so on.
    vertices: Vec<u32>,
}

impl Draft {
    /// The whole surface, when voxels count as clay from an occupancy on.
    pub(super) fn of(clay: &Clay, clay_from: u8) -> Self {
        let mut draft = Self::default();
        let mut seams = Seams::new(clay.grid());
        let mut window = Window::empty();
        for index in bricks(clay) {
            if window.look_at(clay, index, clay_from) {
                draft.add(clay, &mut window, Some(&mut seams), index);
            }
        }
        draft
    }

    /// The part of the surface that belongs to a brick.
    pub(super) fn of_brick(clay: &Clay, index: BrickIndex, clay_from: u8) -> Self {
        let mut draft = Self::default();
        let mut window = Window::empty();
        if window.look_at(clay, index, clay_from) {
            draft.add(clay, &mut window, None, index);
        }
        draft
    }

    fn add(
        &mut self,
        clay: &Clay,
        window: &mut Window,
        mut seams: Option<&mut Seams>,
        index: BrickIndex,
    ) {
        window.vertices.fill(NO_VERTEX);
        let lowest = clay
            .grid()
            .brick_coordinates(index)
            .map(|at| HALO - usize::from(at == 0));
        for axis in 0..3 {
            // Where the grid begins, the edges from the air before it are this brick's, too.
            let mut from = [HALO; 3];
            from[axis] = lowest[axis];
            for z in from[2]..HALO + BRICK_EDGE {
                for y in from[1]..HALO + BRICK_EDGE {
                    let here = window.clay[z][y];
                    let there = match axis {
                        0 => here >> 1,
                        1 => window.clay[z][y + 1],
                        _ => window.clay[z + 1][y],
                    };
                    let mut changes = (here ^ there) & bits(from[0], HALO + BRICK_EDGE);
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
    fn add_quad(
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
    fn vertex(
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
    fn place(&self, shift: f32, places: &mut Vec<[f32; 3]>) {
        places.clear();
        places.extend(self.vertices.iter().map(|vertex| {
            let within = vertex.within(shift);
            std::array::from_fn(|axis| f32::from(vertex.cell[axis]) + within[axis])
        }));
    }

    fn triangles(&self, places: &[[f32; 3]]) -> impl Iterator<Item = [u32; 3]> {
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

impl Window {
    fn empty() -> Self {
        Self {
            first: [0; 3],
            occupancies: Box::new([[[0; EDGE]; EDGE]; EDGE]),
            clay: Box::new([[0; EDGE]; EDGE]),
            vertices: vec![NO_VERTEX; MOST_LOOPS * CELLS_IN_ALL],
        }
    }

    /// Takes in a brick and its halo; `false` if no edge that belongs to it leads from clay to air.
    fn look_at(&mut self, clay: &Clay, index: BrickIndex, clay_from: u8) -> bool {
        let at = clay.grid().brick_coordinates(index);
        let views = std::array::from_fn(|number| {
            let brick = [number % 3, number / 3 % 3, number / 9];
            let brick: [_; 3] =
                std::array::from_fn(|axis| (at[axis] + brick[axis] as u16).checked_sub(1));
            match brick {
                [Some(x), Some(y), Some(z)] => {
                    let index = clay.grid().brick_at([x, y, z]);
                    index.map_or(BrickView::Empty, |index| clay.brick(index))
                }
                _ => BrickView::Empty,
            }
        });
        if has_no_surface(&views, at.contains(&0)) {
            return false;
        }
        self.first = at.map(|at| at as i16 * BRICK_EDGE as i16);
        for z in 0..EDGE {
            let (brick_z, voxel_z) = brick_and_voxel(z);
            for y in 0..EDGE {
                let (brick_y, voxel_y) = brick_and_voxel(y);
                let row = &mut self.occupancies[z][y];
                let first = (voxel_z * BRICK_EDGE + voxel_y) * BRICK_EDGE;
                for (brick_x, (from, until)) in PARTS.into_iter().enumerate() {
                    let part = &mut row[from..until];
                    match views[(brick_z * 3 + brick_y) * 3 + brick_x] {
                        BrickView::Empty => part.fill(0),
                        BrickView::Full => part.fill(SOLID),
                        BrickView::Voxels(voxels) => {
                            let (_, voxel_x) = brick_and_voxel(from);
                            let first = first + voxel_x;
                            part.copy_from_slice(&voxels[first..first + until - from]);
                        }
                    }
                }
                self.clay[z][y] = row.iter().enumerate().fold(0, |clay, (x, &occupancy)| {
                    clay | u32::from(clay_from <= occupancy) << x
                });
            }
        }
        true
    }

    /// Which corners of a cell are clay.
    fn corners(&self, [x, y, z]: [usize; 3]) -> Corners {
        let pair = |z: usize, y: usize| (self.clay[z][y] >> x & 0b11) as u8;
        pair(z, y) | pair(z, y + 1) << 2 | pair(z + 1, y) << 4 | pair(z + 1, y + 1) << 6
    }

    fn occupancies_at(&self, [x, y, z]: [usize; 3]) -> [u8; 8] {
        std::array::from_fn(|corner| {
            self.occupancies[z + (corner >> 2)][y + (corner >> 1 & 1)][x + (corner & 1)]
        })
    }

    /// The loops of a cell: a face that it and the cell beyond find pinched is decided the other way.
    fn loops(&self, cell: [usize; 3], corners: Corners) -> &'static Loops {
        let configuration = Configuration::at(corners);
        let Some(face) = configuration.pinched() else {
            return configuration.clay_apart();
        };
        let (axis, is_high) = (usize::from(face / 2), face & 1 == 1);
        let mut beyond = cell;
        beyond[axis] = if is_high {
            cell[axis] + 1
        } else {
            cell[axis] - 1
        };
        if Configuration::at(self.corners(beyond)).pinched() == Some(face ^ 1) {
            configuration.air_apart()
        } else {
            configuration.clay_apart()
        }
    }
}

/// Where a row of a window passes from one brick to the next.
const PARTS: [(usize, usize); 3] = [
    (0, HALO),
    (HALO, HALO + BRICK_EDGE),
    (HALO + BRICK_EDGE, EDGE),
];

/// In which of three bricks in a row a place of a window is, and where in the brick.
const fn brick_and_voxel(at: usize) -> (usize, usize) {
    let at = at + BRICK_EDGE - HALO;
    (at / BRICK_EDGE, at % BRICK_EDGE)
}

/// Whether a brick, the three beyond it and, where the grid begins, the air before it are all clay or all air.
fn has_no_surface(views: &[BrickView<'_>; 27], is_first: bool) -> bool {
    const MIDDLE: usize = 13;
    let here = views[MIDDLE];
    !matches!(here, BrickView::Voxels(_))
        && [1, 3, 9].iter().all(|step| views[MIDDLE + step] == here)
        && (here == BrickView::Empty || !is_first)
}

fn bricks(clay: &Clay) -> impl Iterator<Item = BrickIndex> {
    let grid = *clay.grid();
    (0..grid.brick_count() as u32).filter_map(move |dense| grid.brick_index(dense))
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
