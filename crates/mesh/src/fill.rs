//! A closed mesh as clay.
//!
//! The occupancy of a voxel is the share of it that is inside, measured along [`LINES`] lines through it, parallel to
//! z. Inside is where the mesh goes around: where the triangles passed from below, counted by the way they face, do not
//! cancel. So shells that overlap are one body, a shell within another is no more than the other was, and one that
//! faces inwards is a hollow.
//!
//! # The lines
//!
//! Along y, planes are a fraction `1/LINES` of a voxel apart. In each plane there is one line through every column of
//! voxels, at the same place in each. From plane to plane that place goes through all fractions along x, in the order
//! of their bits reversed. So a face across x or across y is placed to half a fraction, as well as by the square of as
//! many lines. Along z the lines are measured to 2^-16 of a voxel.
//!
//! # No line leaks
//!
//! A plane cuts a triangle if one of its corners is on or below the plane and another one above. Then two of its edges
//! cross, and where they do is calculated for each edge by itself, from its lower end: the two triangles at an edge
//! get the same bits. So the cuts of all triangles are closed chains, to the bit. Each piece of a chain is passed by
//! the lines between its ends, the first end included and the last one not: a line passes a closed chain as often one
//! way as the other. Nothing depends on how accurately anything is calculated, on corners that lie in a plane, or on
//! triangles without area.

use teleclay_clay::{BRICK_EDGE, BRICK_VOXELS, BrickView, Clay, Grid, SOLID};

use crate::error::MeshError;
use crate::triangles::TriangleMesh;

/// Lines through a voxel; a power of two.
pub const LINES: usize = 64;
/// Along a line, lengths are whole numbers of this fraction of a voxel: sums of them are exact.
const LENGTH_BITS: u32 = 16;
const LENGTHS_PER_VOXEL: f64 = (1 << LENGTH_BITS) as f64;
/// A voxel that is inside along all of its lines.
const FULL: i32 = (LINES as i32) << LENGTH_BITS;
/// A mesh may stand out of the block by half a voxel, as the surface of clay itself does: it lies between the centres
/// of voxels, and beyond the last of them there is air. Slightly more is rounding.
const STANDS_OUT_VOXELS: f64 = 0.5 + 1e-6;

/// Where a mesh goes in the block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// Where it is: the origin of the mesh is the lower corner of the block. What stands out by less than half a voxel
    /// is cut off; what stands out by more is refused.
    AsIs,
    /// As large as it is, the middle of its bounding box in the middle of the block.
    Centred,
    /// Scaled alike along all axes until its bounding box touches two opposite faces of the block, at least one pair,
    /// and centred.
    Fitted,
}

/// A block of clay with the shape of the mesh. It began with what it holds: nothing counts as removed.
///
/// # Errors
/// When the mesh is larger than the block or outside of it, or has no clay at this size of voxels.
///
/// ```
/// use teleclay_clay::Grid;
/// use teleclay_mesh::{MeshError, Placement, TriangleMesh, fill};
///
/// let mesh = TriangleMesh::new(
///     vec![[0.0; 3], [0.3, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.3]],
///     vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
/// )?;
/// let block = Grid::of_voxels([60, 60, 60], 1e-3)?;
///
/// let clay = fill(&mesh, &block, Placement::Fitted)?;
/// let wanted_m3 = 0.03 * 0.06 * 0.03 / 6.0;
/// assert!((clay.remaining_volume_m3() / wanted_m3 - 1.0).abs() < 2e-3);
/// assert!(matches!(
///     fill(&mesh, &block, Placement::AsIs),
///     Err(MeshError::TooLarge { .. })
/// ));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fill(mesh: &TriangleMesh, grid: &Grid, placement: Placement) -> Result<Clay, MeshError> {
    let corners = placed(mesh, grid, placement)?;
    let (voxels, units) = scan(&corners, mesh.triangles(), grid);
    drop(corners);
    if units == 0 {
        return Err(MeshError::Empty);
    }
    let bricks = voxels.as_chunks::<BRICK_VOXELS>().0;
    let content = Clay::from_bricks(*grid, units, |index| {
        BrickView::Voxels(&bricks[index.as_u32() as usize])
    });
    Ok(content.expect("lines run inside the grid only, and the units are its sum"))
}

/// The vertices in the block, in voxels.
fn placed(
    mesh: &TriangleMesh,
    grid: &Grid,
    placement: Placement,
) -> Result<Vec<[f64; 3]>, MeshError> {
    let voxel_m = grid.voxel_size_m();
    let voxels = grid.voxels().map(f64::from);
    let block_m = voxels.map(|count| count * voxel_m);
    let (lower_m, upper_m) = mesh.bounds_m();
    let mesh_m = [0, 1, 2].map(|axis| upper_m[axis] - lower_m[axis]);
    let stands_out_m = STANDS_OUT_VOXELS * voxel_m;
    if placement != Placement::Fitted {
        if (0..3).any(|axis| block_m[axis] + 2.0 * stands_out_m < mesh_m[axis]) {
            return Err(MeshError::TooLarge { mesh_m, block_m });
        }
        let is_outside = (0..3).any(|axis| {
            lower_m[axis] < -stands_out_m || block_m[axis] + stands_out_m < upper_m[axis]
        });
        if placement == Placement::AsIs && is_outside {
            return Err(MeshError::Outside {
                lower_m,
                upper_m,
                block_m,
            });
        }
    }
    let scale = match placement {
        Placement::AsIs | Placement::Centred => 1.0 / voxel_m,
        // No side of a mesh is zero.
        Placement::Fitted => (0..3).fold(f64::INFINITY, |scale, axis| {
            scale.min(voxels[axis] / mesh_m[axis])
        }),
    };
    let place = |at_m: &[f64; 3]| match placement {
        Placement::AsIs => at_m.map(|at| at / voxel_m),
        Placement::Centred | Placement::Fitted => [0, 1, 2].map(|axis| {
            let margin = 0.5 * (voxels[axis] - mesh_m[axis] * scale);
            (at_m[axis] - lower_m[axis]) * scale + margin
        }),
    };
    Ok(mesh.vertices_m().iter().map(place).collect())
}

/// The occupancies, brick by brick, and their sum.
fn scan(corners: &[[f64; 3]], triangles: &[[u32; 3]], grid: &Grid) -> (Vec<u8>, u64) {
    let [columns, rows, height] = grid.voxels().map(usize::from);
    let planes = Planes::of(corners, triangles, rows * LINES);
    let mut voxels = vec![0; grid.brick_count() * BRICK_VOXELS];
    let mut units = 0;
    let mut active: Vec<u32> = Vec::new();
    let mut passes = Vec::new();
    let mut row = Row::new(columns, height);
    for y in 0..rows {
        for fraction in 0..LINES {
            let plane = y * LINES + fraction;
            active.extend_from_slice(planes.beginning_at(plane));
            active.retain(|&triangle| planes.reaches(triangle, plane));
            let line = Line {
                y: (plane as f64 + 0.5) / LINES as f64,
                offset: (bits_reversed(fraction) as f64 + 0.5) / LINES as f64,
            };
            passes.clear();
            for &triangle in &active {
                let corners = triangles[triangle as usize].map(|at| corners[at as usize]);
                line.pass(corners, columns, height, &mut passes);
            }
            // By column, and from below in each: whichever triangle came first.
            passes.sort_unstable();
            row.add(&passes);
        }
        units += row.finish(y, grid, &mut voxels);
    }
    (voxels, units)
}

/// Which planes cut each triangle, at most.
struct Planes {
    /// Triangles in the order of their first planes.
    order: Vec<u32>,
    /// Where in that order those of each plane begin, and where the last ones end.
    starts: Vec<u32>,
    /// The last plane of each triangle.
    last: Vec<u32>,
}

impl Planes {
    fn of(corners: &[[f64; 3]], triangles: &[[u32; 3]], planes: usize) -> Self {
        let mut starts = vec![0; planes + 1];
        let mut last = vec![0; triangles.len()];
        let range = |triangle: &[u32; 3]| {
            let y = triangle.map(|at| corners[at as usize][1] * LINES as f64 - 0.5);
            let lowest = y[0].min(y[1]).min(y[2]);
            let highest = y[0].max(y[1]).max(y[2]);
            // One more at either end, however this was rounded. What begins beyond the last plane has none.
            let is_beyond = highest < -1.0 || planes as f64 <= lowest - 1.0;
            let first = (lowest - 1.0).floor().max(0.0) as usize;
            let end = (highest + 1.0).ceil().max(0.0).min(planes as f64) as u32;
            (!is_beyond && first < planes).then_some((first, end))
        };
        for (triangle, last) in triangles.iter().zip(&mut last) {
            if let Some((first, end)) = range(triangle) {
                starts[first + 1] += 1;
                *last = end;
            }
        }
        for plane in 0..planes {
            starts[plane + 1] += starts[plane];
        }
        let mut next = starts.clone();
        let mut order = vec![0; starts[planes] as usize];
        for (number, triangle) in triangles.iter().enumerate() {
            if let Some((first, _)) = range(triangle) {
                order[next[first] as usize] = number as u32;
                next[first] += 1;
            }
        }
        Self {
            order,
            starts,
            last,
        }
    }

    fn beginning_at(&self, plane: usize) -> &[u32] {
        &self.order[self.starts[plane] as usize..self.starts[plane + 1] as usize]
    }

    fn reaches(&self, triangle: u32, plane: usize) -> bool {
        plane <= self.last[triangle as usize] as usize
    }
}

/// The lines of one plane, one through each column of voxels.
struct Line {
    /// The plane, voxels.
    y: f64,
    /// Where in its voxel each line is along x.
    offset: f64,
}

impl Line {
    /// Notes where the lines pass a triangle.
    fn pass(&self, corners: [[f64; 3]; 3], columns: usize, height: usize, passes: &mut Vec<Pass>) {
        // Where the triangle's border comes up through the plane, and where it goes down.
        let (mut up, mut down) = (None, None);
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (from, to) = (corners[from], corners[to]);
            match (self.y < from[1], self.y < to[1]) {
                (false, true) => up = Some(self.crossing(from, to)),
                (true, false) => down = Some(self.crossing(to, from)),
                _ => {}
            }
        }
        let (Some(up), Some(down)) = (up, down) else {
            return;
        };
        let first = |x: f64| (x - self.offset).ceil().max(0.0).min(columns as f64) as usize;
        let (left, right, facing) = if up[0] <= down[0] {
            (up, down, Facing::One)
        } else {
            (down, up, Facing::Other)
        };
        let (lowest, highest) = (left[1].min(right[1]), left[1].max(right[1]));
        let width = right[0] - left[0];
        for column in first(left[0])..first(right[0]) {
            let share = (column as f64 + self.offset - left[0]) / width;
            let z = left[1] + (right[1] - left[1]) * share;
            // Between the ends, however this was rounded.
            let z = z.max(lowest).min(highest).max(0.0).min(height as f64);
            passes.push(Pass::new(column, z, facing));
        }
    }

    /// Where an edge crosses the plane, x and z; its lower end comes first.
    fn crossing(&self, low: [f64; 3], high: [f64; 3]) -> [f64; 2] {
        let share = (self.y - low[1]) / (high[1] - low[1]);
        [0, 2].map(|axis| low[axis] + (high[axis] - low[axis]) * share)
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Facing {
    One,
    Other,
}

/// A line passes a triangle. In the order of columns, then of heights: the column above the height, 26 bits and more,
/// above a bit for the way the triangle faces.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Pass(u64);

impl Pass {
    fn new(column: usize, z: f64, facing: Facing) -> Self {
        let length = (z * LENGTHS_PER_VOXEL + 0.5) as u64;
        Self((column as u64) << 32 | length << 1 | u64::from(facing == Facing::Other))
    }

    const fn column(self) -> usize {
        (self.0 >> 32) as usize
    }

    /// How high, in lengths.
    const fn height(self) -> usize {
        (self.0 as u32 >> 1) as usize
    }

    const fn sign(self) -> i64 {
        if self.0 & 1 == 0 { 1 } else { -1 }
    }
}

/// A row of voxels along x, of all heights: how much of each is inside, as differences along z.
struct Row {
    /// Voxels along z, and two more: one for what begins at the top, one for what follows it.
    stride: usize,
    differences: Vec<i32>,
}

impl Row {
    fn new(columns: usize, height: usize) -> Self {
        let stride = height + 2;
        Self {
            stride,
            differences: vec![0; columns * stride],
        }
    }

    /// Adds what is inside along the lines of a plane.
    fn add(&mut self, passes: &[Pass]) {
        for line in passes.chunk_by(|a, b| a.column() == b.column()) {
            let column = &mut self.differences[line[0].column() * self.stride..][..self.stride];
            let mut winding = 0;
            for pass in line {
                let before = winding;
                winding += pass.sign();
                match (before == 0, winding == 0) {
                    (true, false) => step(column, pass.height(), 1),
                    (false, true) => step(column, pass.height(), -1),
                    _ => {}
                }
            }
        }
    }

    /// Writes the row's occupancies to its bricks, returns their sum, and is empty again.
    fn finish(&mut self, y: usize, grid: &Grid, voxels: &mut [u8]) -> u64 {
        let [bricks_x, bricks_y, _] = grid.bricks().map(usize::from);
        let height = self.stride - 2;
        let mut units = 0;
        for (x, column) in self.differences.chunks_exact_mut(self.stride).enumerate() {
            let mut inside = 0;
            for (z, difference) in column[..height].iter().enumerate() {
                inside += difference;
                if inside == 0 {
                    continue;
                }
                let occupancy = occupancy(inside);
                units += u64::from(occupancy);
                let [bx, by, bz] = [x, y, z].map(|at| at / BRICK_EDGE);
                let [x, y, z] = [x, y, z].map(|at| at % BRICK_EDGE);
                let brick = (bz * bricks_y + by) * bricks_x + bx;
                let voxel = (z * BRICK_EDGE + y) * BRICK_EDGE + x;
                voxels[brick * BRICK_VOXELS + voxel] = occupancy;
            }
            column.fill(0);
        }
        units
    }
}

/// From a height on, all is inside, or nothing any more.
fn step(column: &mut [i32], height: usize, sign: i32) {
    let (voxel, fraction) = (height >> LENGTH_BITS, (height & 0xffff) as i32);
    column[voxel] += sign * ((1 << LENGTH_BITS) - fraction);
    column[voxel + 1] += sign * fraction;
}

/// The nearest occupancy to what is inside along all lines.
fn occupancy(inside: i32) -> u8 {
    ((i64::from(inside) * i64::from(SOLID) + i64::from(FULL / 2)) / i64::from(FULL)) as u8
}

fn bits_reversed(fraction: usize) -> usize {
    fraction.reverse_bits() >> (usize::BITS - LINES.trailing_zeros())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the planes and the lines themselves, where a line could pass both triangles at an edge, or neither.
    const AWKWARD: [f64; 6] = [
        0.5 / LINES as f64,
        1.5 / LINES as f64,
        (LINES / 2) as f64 / LINES as f64 + 0.5 / LINES as f64,
        1.0,
        2.0 - 0.5 / LINES as f64,
        1.3,
    ];

    /// An octahedron of which every corner is somewhere awkward: it folds, and cuts through itself.
    fn corners(case: usize) -> Vec<[f64; 3]> {
        let at = |digit: usize| AWKWARD[case / 6_usize.pow(digit as u32 % 7) % 6];
        (0..6)
            .map(|corner| [at(corner), at(corner + 2), at(corner + 5)])
            .collect()
    }

    #[test]
    fn no_line_leaks_however_corners_lie() {
        let triangles = [
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
        ];
        let mut passed = 0;
        for case in (0..6_usize.pow(7)).step_by(97) {
            let corners = corners(case);
            for plane in 0..2 * LINES {
                let fraction = plane % LINES;
                let line = Line {
                    y: (plane as f64 + 0.5) / LINES as f64,
                    offset: (bits_reversed(fraction) as f64 + 0.5) / LINES as f64,
                };
                let mut passes = Vec::new();
                for triangle in triangles {
                    line.pass(triangle.map(|at| corners[at]), 2, 2, &mut passes);
                }
                passes.sort_unstable();
                for line in passes.chunk_by(|a, b| a.column() == b.column()) {
                    let sum: i64 = line.iter().map(|pass| pass.sign()).sum();
                    assert_eq!(sum, 0, "case {case}, plane {plane}");
                }
                passed += passes.len();
            }
        }
        assert!(10_000 < passed, "only {passed} triangles were passed");
    }

    #[test]
    fn the_lines_of_a_column_are_all_different_in_x_as_in_y() {
        let mut offsets: Vec<usize> = (0..LINES).map(bits_reversed).collect();
        offsets.sort_unstable();
        assert_eq!(offsets, (0..LINES).collect::<Vec<_>>());
    }
}
