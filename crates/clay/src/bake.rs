//! A closed mesh as signed distances on a small lattice of its own, from which it cuts without looking at triangles.
//!
//! Baking happens once, before any tick. Only additions, multiplications, divisions, square roots and comparisons in
//! double precision go into it, so every machine gets the same bits. Near the surface distances are exact; farther off
//! each node takes the triangle that one of its neighbours found nearest, which there is as good as the nearest.

use thiserror::Error;

use crate::hash;
use crate::tool::MAX_TOOL_SIZE_M;

/// Most triangles of a tool.
pub const MAX_MESH_TRIANGLES: usize = 20_000;
/// Cells along the longest extent of the mesh.
const CELLS: f64 = 48.0;
/// Cells beyond the mesh on every side: what lies farther off is bounded by the distance from there.
const MARGIN: f64 = 3.0;
/// Cells on either side of a triangle within which distances are exact.
const BAND: f64 = 2.0;
/// Most looks at a node for a triangle near it: a mesh of many large triangles across each other takes more.
const MOST_LOOKS: usize = 50_000_000;
/// Points that feel.
const SAMPLES: usize = 512;
/// Steps of a sequence that spreads points evenly over a square,: powers of the
/// inverse of the plastic number.
const SPREAD: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// A mesh that cannot be a tool.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum MeshToolError {
    /// More triangles than a tool may have, or none.
    #[error("mesh has {got} triangles, wanted 1 to {MAX_MESH_TRIANGLES}")]
    Triangles {
        /// Their number.
        got: usize,
    },
    /// A corner that is not there.
    #[error("triangle {triangle} names a vertex that is not there")]
    NoVertex {
        /// The triangle's number.
        triangle: usize,
    },
    /// A coordinate that is not finite, or a vertex farther from the tool's position than a tool is large.
    #[error("vertex {vertex} is not within {MAX_TOOL_SIZE_M} m of the tool's position")]
    Far {
        /// The vertex's number.
        vertex: usize,
    },
    /// An edge that triangles do not pass equally often in both directions.
    #[error("mesh is not closed")]
    Open,
    /// Too many large triangles.
    #[error("mesh takes too long to bake: too many of its triangles are large")]
    Costly,
    /// Facing inwards, or so thin that no node of the lattice lies within it.
    #[error("mesh encloses nothing, faces inwards or is thinner than a fiftieth of its length")]
    Thin,
}

/// Signed distances, and points that feel.
#[derive(Debug)]
pub(crate) struct Baked {
    /// Nodes along each axis.
    pub(crate) nodes: [usize; 3],
    /// From the tool's position to the first node, m.
    pub(crate) first_m: [f64; 3],
    /// Edge of a cell, m.
    pub(crate) cell_m: f64,
    /// Distance outside the mesh of each node, in cells, x fastest.
    pub(crate) distance: Box<[f32]>,
    /// Of the mesh, from the tool's position, m.
    pub(crate) bounds_m: [[f64; 3]; 2],
    /// Twice the distance of the deepest node, m.
    pub(crate) thickness_m: f64,
    /// Points on the surface, with their normals, and the area that each stands for, m².
    pub(crate) samples: Box<[Sample]>,
    /// Depends on every bit of the lattice and the points.
    pub(crate) digest: u64,
}

/// A point on the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// From the tool's position, m.
    pub(crate) place_m: [f64; 3],
    pub(crate) normal: [f64; 3],
    pub(crate) area_m2: f64,
}

impl Baked {
    /// From a closed mesh that faces outwards, in metres from the tool's position.
    pub(crate) fn new(
        vertices_m: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Self, MeshToolError> {
        if triangles.is_empty() || MAX_MESH_TRIANGLES < triangles.len() {
            return Err(MeshToolError::Triangles {
                got: triangles.len(),
            });
        }
        let is_near = |at: &f64| at.abs() <= MAX_TOOL_SIZE_M;
        if let Some(vertex) = vertices_m.iter().position(|at| !at.iter().all(is_near)) {
            return Err(MeshToolError::Far { vertex });
        }
        let mut corners_m = Vec::with_capacity(triangles.len());
        for (triangle, &corners) in triangles.iter().enumerate() {
            let corner = |number: u32| vertices_m.get(number as usize).copied();
            match corners.map(corner) {
                [Some(a), Some(b), Some(c)] => corners_m.push([a, b, c]),
                _ => return Err(MeshToolError::NoVertex { triangle }),
            }
        }
        if !is_closed(triangles) {
            return Err(MeshToolError::Open);
        }
        let corners = || corners_m.iter().flatten();
        let bound = |axis: usize, of: fn(f64, f64) -> f64, start: f64| {
            corners().fold(start, |bound, at| of(bound, at[axis]))
        };
        let least = [0, 1, 2].map(|axis| bound(axis, f64::min, f64::INFINITY));
        let most = [0, 1, 2].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY));
        let extents = sub(most, least);
        let cell_m = extents.into_iter().fold(0.0, f64::max) / CELLS;
        if !(0.0 < cell_m) {
            return Err(MeshToolError::Thin);
        }
        let nodes =
            extents.map(|extent| (extent / cell_m).ceil() as usize + 1 + 2 * MARGIN as usize);
        // In the middle of its lattice, off the nodes: planes of a mesh that nodes lie on are no matter, but few do so.
        let first_m = std::array::from_fn(|axis| {
            let over = (nodes[axis] - 1) as f64 * cell_m - extents[axis];
            least[axis] - 0.5 * over
        });
        // In cells, from the first node.
        let in_cells: Vec<[[f64; 3]; 3]> = corners_m
            .iter()
            .map(|corners| corners.map(|at| sub(at, first_m).map(|way| way / cell_m)))
            .collect();
        let inside = inside(nodes, &in_cells)?;
        let nearest = nearest(nodes, &in_cells)?;
        let distance: Box<[f32]> = nearest
            .into_iter()
            .zip(&inside)
            .map(|(squared, &is_inside)| {
                let distance = squared.sqrt();
                (if is_inside { -distance } else { distance }) as f32
            })
            .collect();
        let deepest = distance.iter().copied().fold(0.0, f32::min);
        if !(deepest < 0.0) {
            return Err(MeshToolError::Thin);
        }
        let samples = samples(&corners_m);
        let mut digest = nodes
            .iter()
            .fold(0, |digest, &count| hash::fold(digest, count as u64));
        for number in first_m.into_iter().chain([cell_m]) {
            digest = hash::fold(digest, number.to_bits());
        }
        for node in &distance {
            digest = hash::fold(digest, node.to_bits().into());
        }
        for sample in &samples {
            let numbers = sample.place_m.into_iter().chain(sample.normal);
            for number in numbers.chain([sample.area_m2]) {
                digest = hash::fold(digest, number.to_bits());
            }
        }
        Ok(Self {
            nodes,
            first_m,
            cell_m,
            distance,
            bounds_m: [least, most],
            thickness_m: -2.0 * f64::from(deepest) * cell_m,
            samples,
            digest,
        })
    }
}

/// Whether triangles pass every edge as often forth as back.
fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut edges: Vec<(u32, u32, i32)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(from, to)| (from.min(to), from.max(to), if from < to { 1 } else { -1 }))
        .collect();
    edges.sort_unstable();
    edges
        .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
        .all(|passed| passed.iter().map(|&(_, _, way)| way).sum::<i32>() == 0)
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

/// Which nodes are inside: along each line of nodes parallel to x, triangles that face back are ways in, others ways out.
///
/// A line that meets an edge or a corner counts as one that passes a little to one side of it, the same for all
/// triangles there, so that it crosses one of them and not none or two.
fn inside(nodes: [usize; 3], triangles: &[[[f64; 3]; 3]]) -> Result<Vec<bool>, MeshToolError> {
    let [nx, ny, nz] = nodes;
    // What begins at each node of a line, and behind the last one what is left over.
    let mut turns = vec![0_i32; (nx + 1) * ny * nz];
    for triangle in triangles {
        let range = |axis: usize, last: usize| {
            let [low, high] = extremes(triangle, axis);
            low.ceil().max(0.0) as usize..(high.floor() + 1.0).clamp(0.0, last as f64) as usize
        };
        let [low, high] = extremes(triangle, 0);
        let [a, b, c] = triangle;
        let normal = cross(sub(*b, *a), sub(*c, *a));
        for z in range(2, nz) {
            for y in range(1, ny) {
                let line = [y as f64, z as f64];
                let sides = [
                    is_left(a, b, line),
                    is_left(b, c, line),
                    is_left(c, a, line),
                ];
                let turn = match sides {
                    [true, true, true] => -1,
                    [false, false, false] => 1,
                    _ => continue,
                };
                let across = normal[1] * (line[0] - a[1]) + normal[2] * (line[1] - a[2]);
                let x = (a[0] - across / normal[0]).max(low).min(high).ceil();
                turns[(z * ny + y) * (nx + 1) + (x as usize).min(nx)] += turn;
            }
        }
    }
    let mut inside = Vec::with_capacity(nx * ny * nz);
    for line in turns.chunks(nx + 1) {
        let mut winding = 0;
        for (at, turn) in line.iter().enumerate() {
            winding += turn;
            if at < nx {
                inside.push(0 < winding);
            }
        }
        if winding != 0 {
            return Err(MeshToolError::Open);
        }
    }
    Ok(inside)
}

fn extremes(triangle: &[[f64; 3]; 3], axis: usize) -> [f64; 2] {
    let along = triangle.map(|at| at[axis]);
    [
        along.into_iter().fold(f64::INFINITY, f64::min),
        along.into_iter().fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// Whether a line parallel to x is left of an edge, seen from x: in either direction of the edge the opposite.
fn is_left(from: &[f64; 3], to: &[f64; 3], [y, z]: [f64; 2]) -> bool {
    let is_forth = (from[1], from[2]) < (to[1], to[2]);
    let (a, b) = if is_forth { (from, to) } else { (to, from) };
    let side = (b[1] - a[1]) * (z - a[2]) - (b[2] - a[2]) * (y - a[1]);
    (0.0 <= side) == is_forth
}

/// Square of each node's distance from the triangle that is found nearest, in cells.
fn nearest(nodes: [usize; 3], triangles: &[[[f64; 3]; 3]]) -> Result<Vec<f64>, MeshToolError> {
    let [nx, ny, nz] = nodes;
    let mut found = vec![(f64::INFINITY, u32::MAX); nx * ny * nz];
    let try_one = |found: &mut (f64, u32), number: u32, at: [usize; 3]| {
        let squared = squared_distance(&triangles[number as usize], at.map(|at| at as f64));
        if squared < found.0 {
            *found = (squared, number);
        }
    };
    let mut looks = 0;
    for (number, triangle) in triangles.iter().enumerate() {
        let [xs, ys, zs] = [0, 1, 2].map(|axis| {
            let [low, high] = extremes(triangle, axis);
            let first = (low - BAND).ceil().max(0.0) as usize;
            first..((high + BAND).floor() as usize + 1).min(nodes[axis])
        });
        looks += xs.len() * ys.len() * zs.len();
        if MOST_LOOKS < looks {
            return Err(MeshToolError::Costly);
        }
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    try_one(&mut found[(z * ny + y) * nx + x], number as u32, [x, y, z]);
                }
            }
        }
    }
    // Forth and back, twice, every node asks those beside it that were before it.
    for pass in 0..4 {
        for count in 0..found.len() {
            let node = if pass % 2 == 0 {
                count
            } else {
                found.len() - 1 - count
            };
            let at = [node % nx, node / nx % ny, node / nx / ny];
            for beside in 0..13 {
                let offset =
                    [beside % 3, beside / 3 % 3, beside / 9].map(|offset| offset as isize - 1);
                let offset = if pass % 2 == 0 {
                    offset
                } else {
                    offset.map(|offset| -offset)
                };
                let there: [isize; 3] =
                    std::array::from_fn(|axis| at[axis] as isize + offset[axis]);
                if (0..3).any(|axis| there[axis] < 0 || nodes[axis] as isize <= there[axis]) {
                    continue;
                }
                let [x, y, z] = there.map(|at| at as usize);
                let (_, number) = found[(z * ny + y) * nx + x];
                if number != u32::MAX && number != found[node].1 {
                    try_one(&mut found[node], number, at);
                }
            }
        }
    }
    Ok(found.into_iter().map(|(squared, _)| squared).collect())
}

/// Square of the distance from a triangle: from its corner, edge or face, whichever the point projects onto.
fn squared_distance([a, b, c]: &[[f64; 3]; 3], point: [f64; 3]) -> f64 {
    let squared = |to: [f64; 3]| {
        let way = sub(point, to);
        dot(way, way)
    };
    let along = |from: [f64; 3], way: [f64; 3], share: f64| {
        squared(std::array::from_fn(|axis| from[axis] + share * way[axis]))
    };
    let (ab, ac) = (sub(*b, *a), sub(*c, *a));
    let from_a = sub(point, *a);
    let (d1, d2) = (dot(ab, from_a), dot(ac, from_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return squared(*a);
    }
    let from_b = sub(point, *b);
    let (d3, d4) = (dot(ab, from_b), dot(ac, from_b));
    if 0.0 <= d3 && d4 <= d3 {
        return squared(*b);
    }
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && 0.0 <= d1 && d3 <= 0.0 {
        return along(*a, ab, d1 / (d1 - d3));
    }
    let from_c = sub(point, *c);
    let (d5, d6) = (dot(ab, from_c), dot(ac, from_c));
    if 0.0 <= d6 && d5 <= d6 {
        return squared(*c);
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && 0.0 <= d2 && d6 <= 0.0 {
        return along(*a, ac, d2 / (d2 - d6));
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d3 <= d4 && d6 <= d5 {
        return along(*b, sub(*c, *b), (d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let whole = of_a + of_b + of_c;
    let (v, w) = (of_b / whole, of_c / whole);
    squared(std::array::from_fn(|axis| {
        a[axis] + v * ab[axis] + w * ac[axis]
    }))
}

/// Points for equal areas, in the order of the triangles.
fn samples(triangles: &[[[f64; 3]; 3]]) -> Box<[Sample]> {
    let doubled = |[a, b, c]: &[[f64; 3]; 3]| {
        let normal = cross(sub(*b, *a), sub(*c, *a));
        (normal, dot(normal, normal).sqrt())
    };
    let total_m2: f64 = triangles
        .iter()
        .map(|triangle| 0.5 * doubled(triangle).1)
        .sum();
    let each_m2 = total_m2 / SAMPLES as f64;
    let (mut samples, mut passed_m2) = (Vec::with_capacity(SAMPLES), 0.0);
    let mut spread = [0.5; 2];
    for triangle in triangles {
        let (normal, twice_m2) = doubled(triangle);
        passed_m2 += 0.5 * twice_m2;
        while samples.len() < SAMPLES && (samples.len() as f64 + 0.5) * each_m2 < passed_m2 {
            spread = std::array::from_fn(|of| {
                let next = spread[of] + SPREAD[of];
                if next < 1.0 { next } else { next - 1.0 }
            });
            let [u, v] = spread;
            let [u, v] = if u + v < 1.0 {
                [u, v]
            } else {
                [1.0 - u, 1.0 - v]
            };
            let [a, b, c] = *triangle;
            samples.push(Sample {
                place_m: std::array::from_fn(|axis| {
                    a[axis] + u * (b[axis] - a[axis]) + v * (c[axis] - a[axis])
                }),
                normal: normal.map(|n| n / twice_m2),
                area_m2: each_m2,
            });
        }
    }
    samples.into_boxed_slice()
}
