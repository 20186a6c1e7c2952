//! A brick's part of the surface as a screen draws it: the same vertices and quadrilaterals as everywhere, with the way
//! that they face, in the layout of a graphics card.
//!
//! A face that nobody has cut is 512 triangles a brick, and all of them lie in one plane. Such a *sheet* is drawn as a
//! fan over the rim of its flat part: the rim keeps every vertex, so nothing opens towards a neighbour that is cut.

use crate::grid::BRICK_EDGE;

use super::cell::edge_number;
use super::draft::{Draft, lowest_edges};
use super::facing::normal;
use super::volume::HALF_SOLID;
use super::window::{Bricks, HALO, NO_VERTEX, Window};

/// A brick's part of the surface, before the shift that makes the volume of the whole right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BrickMesh {
    /// Three numbers a vertex: its place in voxels from the lower corner of the grid. Vertices along a seam are the
    /// same in both bricks, bit by bit.
    pub positions: Vec<f32>,
    /// Four numbers a vertex: out of the clay, scaled to 127, and a zero that keeps vertices on four bytes.
    pub facing: Vec<i8>,
    /// Three vertices a triangle, counter-clockwise seen from outside.
    pub indices: Vec<u16>,
}

/// Finds the parts of bricks; what it holds is working memory.
pub(crate) struct BrickMesher {
    window: Window,
    draft: Draft,
    places: Vec<[f32; 3]>,
    /// Triangles of fans.
    fans: Vec<[u32; 3]>,
    normals: Vec<Option<[f32; 3]>>,
    /// Which vertex of the mesh a vertex of the draft has become.
    shown: Vec<u32>,
}

/// A layer of edges along an axis, by the place in the window of the voxels that they begin in. `next` and `last` are
/// the axes across it, in cyclic order.
#[derive(Clone, Copy)]
struct Sheet {
    axis: usize,
    layer: usize,
}

/// Vertices of a sheet, by the places of their cells across it: a flat part from the first to the second, along the
/// next axis and along the last one.
struct Flat {
    next: [usize; 2],
    last: [usize; 2],
}

/// The first, the middle and the last cell across a sheet.
const FIRST: usize = HALO - 1;
const MIDDLE: usize = HALO + BRICK_EDGE / 2 - 1;
const LAST: usize = HALO + BRICK_EDGE - 1;
/// Cosine up to which a vertex faces straight out of its sheet.
const STRAIGHT: f32 = 0.9999;

impl Default for BrickMesher {
    fn default() -> Self {
        Self {
            window: Window::empty(),
            draft: Draft::default(),
            places: Vec::new(),
            fans: Vec::new(),
            normals: Vec::new(),
            shown: Vec::new(),
        }
    }
}

impl BrickMesher {
    /// The part that belongs to the brick at these coordinates, in place of whatever `mesh` holds.
    pub(crate) fn mesh(&mut self, bricks: &impl Bricks, at: [u16; 3], mesh: &mut BrickMesh) {
        mesh.positions.clear();
        mesh.facing.clear();
        mesh.indices.clear();
        self.draft.clear();
        self.fans.clear();
        self.normals.clear();
        if !self.window.look_at(bricks, at, HALF_SOLID) {
            return;
        }
        let lowest = lowest_edges(at);
        let sheets = self.window.sheets(lowest);
        self.draft.add(&mut self.window, None, at, sheets);
        for axis in 0..3 {
            for layer in (lowest[axis]..=LAST).filter(|layer| sheets[axis] >> layer & 1 == 1) {
                self.add_sheet(Sheet { axis, layer });
            }
        }
        self.finish(mesh);
    }

    fn add_sheet(&mut self, sheet: Sheet) {
        let flat = self.flat_part(sheet);
        for last in HALO..=LAST {
            for next in HALO..=LAST {
                if !flat.as_ref().is_some_and(|flat| flat.holds(next, last)) {
                    let voxel = sheet.place(next, last);
                    self.draft
                        .add_quad(&mut self.window, None, voxel, sheet.axis);
                }
            }
        }
        if let Some(flat) = flat {
            self.add_fan(sheet, &flat);
        }
    }

    fn add_fan(&mut self, sheet: Sheet, &Flat { next, last }: &Flat) {
        let centre = self.vertex(sheet, MIDDLE, MIDDLE);
        let [x, y, z] = sheet.place(MIDDLE, MIDDLE);
        let faces_along = self.window.clay[z][y] >> x & 1 == 1;
        let around = (next[0]..next[1]).map(|at| [at, last[0]]);
        let around = around.chain((last[0]..last[1]).map(|at| [next[1], at]));
        let around = around.chain((next[0] + 1..=next[1]).rev().map(|at| [at, last[1]]));
        let around = around.chain((last[0] + 1..=last[1]).rev().map(|at| [next[0], at]));
        let first = self.vertex(sheet, next[0], last[0]);
        let mut from = first;
        for to in around.skip(1).map(Some).chain([None]) {
            let to = to.map_or(first, |[next, last]| self.vertex(sheet, next, last));
            self.fans.push(if faces_along {
                [centre, from, to]
            } else {
                [centre, to, from]
            });
            from = to;
        }
    }

    /// The rectangle of vertices about the middle that lie in one plane and face straight out of it, unless it is too
    /// small to be worth a fan. Its sides are read off the middle row and column: near the edges of a block vertices
    /// turn aside.
    fn flat_part(&mut self, sheet: Sheet) -> Option<Flat> {
        let mut reach = |at: fn(usize) -> [usize; 2], to: usize| {
            let mut end = MIDDLE;
            while end != to {
                let beyond = if end < to { end + 1 } else { end - 1 };
                let [next, last] = at(beyond);
                if !self.is_flat(sheet, next, last) {
                    break;
                }
                end = beyond;
            }
            end
        };
        let flat = Flat {
            next: [FIRST, LAST].map(|to| reach(|at| [at, MIDDLE], to)),
            last: [FIRST, LAST].map(|to| reach(|at| [MIDDLE, at], to)),
        };
        let is_wide = |[from, to]: [usize; 2]| from < MIDDLE && MIDDLE < to;
        let is_fan = is_wide(flat.next)
            && is_wide(flat.last)
            && (flat.last[0]..=flat.last[1]).all(|last| {
                (flat.next[0]..=flat.next[1]).all(|next| self.is_flat(sheet, next, last))
            });
        is_fan.then_some(flat)
    }

    /// Whether a vertex is in the plane of the one in the middle and faces straight out of it, and in the middle of its
    /// cell otherwise.
    fn is_flat(&mut self, sheet: Sheet, next: usize, last: usize) -> bool {
        let Sheet { axis, .. } = sheet;
        let [here, middle] = [[next, last], [MIDDLE; 2]].map(|[next, last]| {
            let number = self.vertex(sheet, next, last);
            self.draft.vertices()[number as usize].within(0.0)
        });
        let mut wanted = [0.5; 3];
        wanted[axis] = middle[axis];
        // The same means of the same numbers: a plane is exact, and what is only nearly one is drawn in full.
        #[allow(clippy::float_cmp)]
        let is_level = here == wanted;
        let number = self.vertex(sheet, next, last);
        is_level && STRAIGHT < self.normal(number)[axis].abs()
    }

    /// The vertex of the cell at these places of a sheet.
    fn vertex(&mut self, sheet: Sheet, next: usize, last: usize) -> u32 {
        // About an edge of the sheet itself: the first cells across it lie before its first voxels.
        let edge = edge_number(
            sheet.axis,
            usize::from(next == FIRST),
            usize::from(last == FIRST),
        );
        let cell = sheet.place(next, last);
        self.draft.vertex(&mut self.window, None, cell, edge)
    }

    fn normal(&mut self, number: u32) -> [f32; 3] {
        let Self {
            window,
            draft,
            normals,
            ..
        } = self;
        let vertices = draft.vertices();
        normals.resize(vertices.len(), None);
        let at = number as usize;
        *normals[at].get_or_insert_with(|| normal(window, &vertices[at]))
    }

    fn finish(&mut self, mesh: &mut BrickMesh) {
        let Self {
            window,
            draft,
            places,
            fans,
            normals,
            shown,
        } = self;
        draft.place(0.0, places);
        let vertices = draft.vertices();
        normals.resize(vertices.len(), None);
        shown.clear();
        shown.resize(vertices.len(), NO_VERTEX);
        let triangles = fans.iter().copied().chain(draft.triangles(places));
        for number in triangles.flatten() {
            let at = number as usize;
            if shown[at] == NO_VERTEX {
                shown[at] = (mesh.positions.len() / 3) as u32;
                // Places count from the centre of the first voxel.
                mesh.positions.extend(places[at].map(|along| along + 0.5));
                let facing = *normals[at].get_or_insert_with(|| normal(window, &vertices[at]));
                let [x, y, z] = facing.map(|along| (127.0 * along).round() as i8);
                mesh.facing.extend([x, y, z, 0]);
            }
            mesh.indices.push(shown[at] as u16);
        }
    }
}

impl Sheet {
    /// The place in the window across it.
    fn place(self, next: usize, last: usize) -> [usize; 3] {
        let mut place = [self.layer; 3];
        place[(self.axis + 1) % 3] = next;
        place[(self.axis + 2) % 3] = last;
        place
    }
}

impl Flat {
    /// Whether the quadrilateral about the edge from this voxel of the sheet is within.
    fn holds(&self, next: usize, last: usize) -> bool {
        let holds = |[from, to]: [usize; 2], at: usize| from < at && at <= to;
        holds(self.next, next) && holds(self.last, last)
    }
}
