//! What a reader of an STL file makes of it: triangles, welded where their corners are the same point.
#![allow(dead_code)] // each test program takes what it needs

use std::collections::HashMap;

use teleclay_clay::{BRICK_EDGE, BRICK_VOXELS, BrickView, Clay, Mesh, Pose, Shape, stl};

/// A triangle's corners, mm.
type Triangle = [[f32; 3]; 3];

/// A closed two-manifold of triangles.
pub(crate) struct Solid {
    /// Volume inside, m³.
    pub(crate) volume_m3: f64,
    /// Volume inside each connected part of the surface, m³; below zero for a cavity.
    pub(crate) parts_m3: Vec<f64>,
    pub(crate) triangles: usize,
    /// Different corners of triangles.
    pub(crate) points: usize,
}

/// A pose in the clay frame, m.
pub(crate) fn at(position_m: [f64; 3]) -> Pose {
    Pose::quantise(position_m).unwrap()
}

impl Solid {
    /// The surface of a clay as its STL file tells of it. Its mesh has every point once.
    pub(crate) fn of(clay: &Clay) -> Result<Self, String> {
        let mesh = Mesh::of(clay);
        let solid = Self::of_mesh(&mesh)?;
        let (points, vertices) = (solid.points, mesh.positions_m.len());
        if points != vertices {
            return Err(format!("{vertices} vertices in {points} points"));
        }
        Ok(solid)
    }

    /// A mesh as its STL file tells of it.
    pub(crate) fn of_mesh(mesh: &Mesh) -> Result<Self, String> {
        Self::read(&triangles_of(&stl::encode(mesh)))
    }

    /// Welds triangles and looks at every edge and every vertex.
    pub(crate) fn read(triangles: &[Triangle]) -> Result<Self, String> {
        let mut points: HashMap<[u32; 3], usize> = HashMap::new();
        let mut corners = Vec::new();
        for triangle in triangles {
            corners.push(triangle.map(|corner| {
                let next = points.len();
                // Both zeros are one place.
                let key = corner.map(|value| (value + 0.0).to_bits());
                *points.entry(key).or_insert(next)
            }));
        }
        let mut next_around: HashMap<(usize, usize), usize> = HashMap::new();
        for (number, &[a, b, c]) in corners.iter().enumerate() {
            if a == b || b == c || c == a || area_mm2(&triangles[number]) <= 0.0 {
                return Err(format!("{:?} has no area", triangles[number]));
            }
            for (from, to, third) in [(a, b, c), (b, c, a), (c, a, b)] {
                if next_around.insert((from, to), third).is_some() {
                    return Err(format!(
                        "two triangles turn the same way about {from} to {to}"
                    ));
                }
            }
        }
        // Each edge once one way is each edge once the other way, too, or it is open.
        if let Some((from, to)) = next_around
            .keys()
            .find(|(from, to)| !next_around.contains_key(&(*to, *from)))
        {
            return Err(format!("the edge from {from} to {to} is open"));
        }
        let mut fans = vec![0; points.len()];
        for corners in &corners {
            for &corner in corners {
                fans[corner] += 1;
            }
        }
        for &[a, b, c] in &corners {
            for (hub, first) in [(a, b), (b, c), (c, a)] {
                let (mut spoke, mut turned) = (first, 0);
                while turned == 0 || spoke != first {
                    spoke = next_around[&(hub, spoke)];
                    turned += 1;
                }
                if turned != fans[hub] {
                    return Err(format!("two fans meet in vertex {hub}"));
                }
            }
        }
        let parts_m3 = parts(triangles, &corners, points.len());
        Ok(Self {
            volume_m3: parts_m3.iter().sum(),
            parts_m3,
            triangles: triangles.len(),
            points: points.len(),
        })
    }
}

/// Volumes of the connected parts.
fn parts(triangles: &[Triangle], corners: &[[usize; 3]], points: usize) -> Vec<f64> {
    let mut part: Vec<usize> = (0..points).collect();
    fn root(part: &mut [usize], mut at: usize) -> usize {
        while part[at] != at {
            part[at] = part[part[at]];
            at = part[at];
        }
        at
    }
    for &[a, b, c] in corners {
        for other in [b, c] {
            let (one, other) = (root(&mut part, a), root(&mut part, other));
            part[other] = one;
        }
    }
    let mut volumes: HashMap<usize, f64> = HashMap::new();
    for (triangle, corners) in triangles.iter().zip(corners) {
        *volumes.entry(root(&mut part, corners[0])).or_default() += cone_m3(triangle);
    }
    volumes.into_values().collect()
}

/// The triangles of a binary STL file, read by its published layout: 80 bytes, a count, 50 bytes each.
pub(crate) fn triangles_of(bytes: &[u8]) -> Vec<Triangle> {
    let count = u32::from_le_bytes(bytes[80..84].try_into().unwrap()) as usize;
    assert_eq!(bytes.len(), 84 + 50 * count);
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let corner = |at: usize| [number(at), number(at + 4), number(at + 8)];
    // The normal comes first.
    (0..count)
        .map(|triangle| [12, 24, 36].map(|offset| corner(84 + 50 * triangle + offset)))
        .collect()
}

fn area_mm2(corners: &Triangle) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let side = |to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| to[axis] - a[axis]) };
    let (u, v) = (side(b), side(c));
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    cross.iter().map(|c| c * c).sum::<f64>().sqrt() / 2.0
}

/// Volume of the cone from the origin to a triangle, m³: these add up to what a surface encloses.
fn cone_m3(corners: &Triangle) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.map(|at_mm| f64::from(at_mm) * 1e-3));
    (a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0]))
        / 6.0
}

/// Clay of these occupancies in a grid of so many voxels.
pub(crate) fn clay_of(
    voxels: [usize; 3],
    voxel_m: f64,
    mut occupancy: impl FnMut([usize; 3]) -> u8,
) -> Clay {
    let size_m = voxels.map(|count| count as f64 * voxel_m);
    let mut clay = Clay::new(&Shape::Block { size_m }, voxel_m).unwrap();
    assert_eq!(clay.grid().voxels().map(usize::from), voxels);
    for dense in 0..clay.grid().brick_count() as u32 {
        let index = clay.grid().brick_index(dense).unwrap();
        let first = clay
            .grid()
            .brick_coordinates(index)
            .map(|at| usize::from(at) * BRICK_EDGE);
        let extent = clay.grid().brick_extent(index);
        let mut content = [0; BRICK_VOXELS];
        for z in 0..extent[2] {
            for y in 0..extent[1] {
                for x in 0..extent[0] {
                    content[(z * BRICK_EDGE + y) * BRICK_EDGE + x] =
                        occupancy([first[0] + x, first[1] + y, first[2] + z]);
                }
            }
        }
        clay.replace_brick(index, BrickView::Voxels(&content))
            .unwrap();
    }
    clay
}

/// Numbers without a pattern, the same every time: a counter, scrambled.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From one number up to another.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.word() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
