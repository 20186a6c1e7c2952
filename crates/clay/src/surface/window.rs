//! A brick with the voxels around it that its surface looks at, laid out flat: nobody asks any more whose voxel it is.

use crate::clay::Clay;
use crate::field::{BrickView, SOLID};
use crate::grid::BRICK_EDGE;

use super::cell::{Configuration, Corners, Loops, MOST_LOOPS};

/// Layers of voxels around a brick. Its cells reach one beyond it. What is across their faces is another one away, and
/// what the direction of a vertex is found from is two away ([`super::facing`]).
pub(crate) const HALO: usize = 3;
/// Voxels along an edge of a brick with its halo.
pub(super) const EDGE: usize = BRICK_EDGE + 2 * HALO;
/// Cells along an edge of a brick: one more than voxels, as they lie between them.
pub(super) const CELLS: usize = BRICK_EDGE + 1;
pub(super) const CELLS_IN_ALL: usize = CELLS * CELLS * CELLS;
/// Of a loop that has no vertex yet.
pub(super) const NO_VERTEX: u32 = u32::MAX;

/// Bricks side by side, from the origin on.
pub(crate) trait Bricks {
    /// What the brick at these coordinates, counted in bricks, holds; beyond the grid there is air.
    fn content(&self, at: [u16; 3]) -> BrickView<'_>;
}

impl Bricks for Clay {
    fn content(&self, at: [u16; 3]) -> BrickView<'_> {
        let index = self.grid().brick_at(at);
        index.map_or(BrickView::Empty, |index| self.brick(index))
    }
}

/// A brick with its halo.
pub(super) struct Window {
    /// The brick's first voxel.
    pub(super) first: [i16; 3],
    pub(super) occupancies: Box<[[[u8; EDGE]; EDGE]; EDGE]>,
    /// Which of them count as clay: a bit for each voxel along x.
    pub(super) clay: Box<[[u32; EDGE]; EDGE]>,
    /// Vertices of the cells' first loops, then of their second ones, and so on.
    pub(super) vertices: Vec<u32>,
}

impl Window {
    pub(super) fn empty() -> Self {
        Self {
            first: [0; 3],
            occupancies: Box::new([[[0; EDGE]; EDGE]; EDGE]),
            clay: Box::new([[0; EDGE]; EDGE]),
            vertices: vec![NO_VERTEX; MOST_LOOPS * CELLS_IN_ALL],
        }
    }

    /// Takes in a brick and its halo; `false` if no edge that belongs to it leads from clay to air.
    pub(super) fn look_at(&mut self, bricks: &impl Bricks, at: [u16; 3], clay_from: u8) -> bool {
        let views = std::array::from_fn(|number| {
            let brick = [number % 3, number / 3 % 3, number / 9];
            let brick: [_; 3] =
                std::array::from_fn(|axis| (at[axis] + brick[axis] as u16).checked_sub(1));
            match brick {
                [Some(x), Some(y), Some(z)] => bricks.content([x, y, z]),
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
    pub(super) fn corners(&self, [x, y, z]: [usize; 3]) -> Corners {
        let pair = |z: usize, y: usize| (self.clay[z][y] >> x & 0b11) as u8;
        pair(z, y) | pair(z, y + 1) << 2 | pair(z + 1, y) << 4 | pair(z + 1, y + 1) << 6
    }

    pub(super) fn occupancies_at(&self, [x, y, z]: [usize; 3]) -> [u8; 8] {
        std::array::from_fn(|corner| {
            self.occupancies[z + (corner >> 2)][y + (corner >> 1 & 1)][x + (corner & 1)]
        })
    }

    /// Layers of edges along each axis, from the lowest ones on, all 16² of which lead from clay to air or all from air
    /// to clay: a bit for each, by the place of the voxels that they begin in.
    pub(super) fn sheets(&self, lowest: [usize; 3]) -> [u32; 3] {
        const BRICK: std::ops::Range<usize> = HALO..HALO + BRICK_EDGE;
        const ROW: u32 = (1 << (HALO + BRICK_EDGE)) - (1 << HALO);
        // Along x a layer is a bit of all rows; along y and z it is rows of its own.
        let (mut falls, mut rises) = (u32::MAX, u32::MAX);
        for row in self.clay[BRICK].iter().flat_map(|rows| &rows[BRICK]) {
            falls &= row & !(row >> 1);
            rises &= !row & row >> 1;
        }
        let is_sheet = |pairs: &mut dyn Iterator<Item = [u32; 2]>| {
            let (mut falls, mut rises) = (ROW, ROW);
            for [here, there] in pairs {
                falls &= here & !there;
                rises &= !here & there;
            }
            falls == ROW || rises == ROW
        };
        let along_y = |y: usize| {
            let rows = &self.clay[BRICK];
            is_sheet(&mut rows.iter().map(|rows| [rows[y], rows[y + 1]]))
        };
        let along_z = |z: usize| {
            let [here, there] = [z, z + 1].map(|z| &self.clay[z][BRICK]);
            is_sheet(&mut here.iter().zip(there).map(|(here, there)| [*here, *there]))
        };
        let layers = |axis: usize| lowest[axis]..BRICK.end;
        let gathered = |axis: usize, is_sheet: &dyn Fn(usize) -> bool| {
            let layers = layers(axis).filter(|&layer| is_sheet(layer));
            layers.fold(0, |bits, layer| bits | 1 << layer)
        };
        [
            gathered(0, &|layer| (falls | rises) >> layer & 1 == 1),
            gathered(1, &along_y),
            gathered(2, &along_z),
        ]
    }

    /// The loops of a cell: a face that it and the cell beyond find pinched is decided the other way.
    pub(super) fn loops(&self, cell: [usize; 3], corners: Corners) -> &'static Loops {
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
