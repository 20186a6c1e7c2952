//! Closed meshes whose volume is known in closed form, and the numbers that tests draw.

#![allow(dead_code, reason = "every test uses some of it")]

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use teleclay_clay::{Clay, Grid, Pose, Shape, Sweep, ToolShape};
use teleclay_mesh::{MeshError, TriangleMesh};

/// Vertices, m, and triangles, before anything is asked of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Parts {
    pub(crate) vertices_m: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Parts {
    pub(crate) fn mesh(&self) -> Result<TriangleMesh, MeshError> {
        TriangleMesh::new(self.vertices_m.clone(), self.triangles.clone())
    }

    /// Each vertex somewhere else.
    pub(crate) fn moved(mut self, to: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        for at_m in &mut self.vertices_m {
            *at_m = to(*at_m);
        }
        self
    }

    pub(crate) fn shifted(self, by_m: [f64; 3]) -> Self {
        self.moved(|at_m| [0, 1, 2].map(|axis| at_m[axis] + by_m[axis]))
    }

    /// Turned about an axis through the origin that goes through nothing in particular.
    pub(crate) fn turned(self, angle_rad: f64) -> Self {
        let axis: [f64; 3] = [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0];
        let (sine, cosine) = angle_rad.sin_cos();
        self.moved(|at| {
            let dot: f64 = (0..3).map(|i| axis[i] * at[i]).sum();
            let cross = [
                axis[1] * at[2] - axis[2] * at[1],
                axis[2] * at[0] - axis[0] * at[2],
                axis[0] * at[1] - axis[1] * at[0],
            ];
            [0, 1, 2].map(|i| at[i] * cosine + cross[i] * sine + axis[i] * dot * (1.0 - cosine))
        })
    }

    /// Facing the other way.
    pub(crate) fn inside_out(mut self) -> Self {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
        self
    }

    pub(crate) fn and(mut self, other: Self) -> Self {
        let first = self.vertices_m.len() as u32;
        self.vertices_m.extend(other.vertices_m);
        let others = other.triangles.into_iter();
        self.triangles
            .extend(others.map(|triangle| triangle.map(|vertex| first + vertex)));
        self
    }

    /// Numbers of a binary STL file, millimetres.
    pub(crate) fn binary_stl(&self) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes.extend_from_slice(&(self.triangles.len() as u32).to_le_bytes());
        for triangle in &self.triangles {
            bytes.extend_from_slice(&[0; 12]);
            for at in triangle {
                for at_m in self.vertices_m[*at as usize] {
                    bytes.extend_from_slice(&((at_m * 1e3) as f32).to_le_bytes());
                }
            }
            bytes.extend_from_slice(&[0, 0]);
        }
        bytes
    }

    /// The same in words.
    pub(crate) fn text_stl(&self) -> String {
        let mut text = String::from("solid a name of words\n");
        for triangle in &self.triangles {
            text += "facet normal 0 0 0\n outer loop\n";
            for at in triangle {
                let [x, y, z] = self.vertices_m[*at as usize].map(|at_m| at_m * 1e3);
                text += &format!("  vertex {x:e} {y} {z}\n");
            }
            text += " endloop\nendfacet\n";
        }
        text + "endsolid a name of words\n"
    }
}

/// A box from one corner to another, two triangles a side: the sides across x, y, z, the lower one first.
pub(crate) fn cuboid(lower_m: [f64; 3], upper_m: [f64; 3]) -> Parts {
    let corner = |bits: usize| {
        [0, 1, 2].map(|axis| {
            if bits >> axis & 1 == 0 {
                lower_m[axis]
            } else {
                upper_m[axis]
            }
        })
    };
    let sides = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    Parts {
        vertices_m: (0..8).map(corner).collect(),
        triangles: sides
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
    }
}

/// Three edges along the axes from the origin.
pub(crate) fn tetrahedron(edges_m: [f64; 3]) -> Parts {
    let [x, y, z] = edges_m;
    Parts {
        vertices_m: vec![[0.0; 3], [x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    }
}

/// A ball about the origin: an octahedron, each triangle of it cut into four so many times.
pub(crate) fn ball(radius_m: f64, cuts: u32) -> Parts {
    let mut points: Vec<[f64; 3]> = (0..6)
        .map(|at| {
            [0, 1, 2].map(|axis| {
                if at / 2 == axis {
                    1.0 - 2.0 * f64::from(at % 2)
                } else {
                    0.0
                }
            })
        })
        .collect();
    let mut triangles: Vec<[u32; 3]> = (0..8_u32)
        .map(|octant| {
            let [x, y, z] = [0, 1, 2].map(|axis| 2 * axis + (octant >> axis & 1));
            if octant.count_ones() % 2 == 0 {
                [x, y, z]
            } else {
                [x, z, y]
            }
        })
        .collect();
    for _ in 0..cuts {
        let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = [0, 1, 2].map(|axis| points[a as usize][axis] + points[b as usize][axis]);
                let length = sum.iter().map(|s| s * s).sum::<f64>().sqrt();
                points.push(sum.map(|s| s / length));
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    Parts {
        vertices_m: points,
        triangles,
    }
    .moved(|at| at.map(|at| at * radius_m))
}

pub(crate) fn ball_volume_m3(radius_m: f64) -> f64 {
    4.0 / 3.0 * PI * radius_m.powi(3)
}

/// A ring about the z axis of so many sides around, and as many along.
pub(crate) fn torus(radius_m: f64, thickness_m: f64, around: u32, along: u32) -> Parts {
    let vertices_m = (0..around * along)
        .map(|at| {
            let (u, v) = (
                TAU * f64::from(at / along) / f64::from(around),
                TAU * f64::from(at % along) / f64::from(along),
            );
            let out_m = radius_m + thickness_m * v.cos();
            [out_m * u.cos(), out_m * u.sin(), thickness_m * v.sin()]
        })
        .collect();
    let triangles = (0..around * along)
        .flat_map(|at| {
            let (u, v) = (at / along, at % along);
            let place = |u: u32, v: u32| u % around * along + v % along;
            let [a, b, c, d] = [
                place(u, v),
                place(u + 1, v),
                place(u + 1, v + 1),
                place(u, v + 1),
            ];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Parts {
        vertices_m,
        triangles,
    }
}

pub(crate) fn torus_volume_m3(radius_m: f64, thickness_m: f64) -> f64 {
    2.0 * PI * PI * radius_m * thickness_m * thickness_m
}

/// A block that tools have cut, by a ball and by a blade.
pub(crate) fn carved() -> Clay {
    let shape = Shape::Block {
        size_m: [0.048, 0.040, 0.032],
    };
    let mut clay = Clay::new(&shape, 1e-3).unwrap();
    let ball = ToolShape::ball(0.006).unwrap();
    for (from_m, to_m) in [
        ([0.0, 0.010, 0.030], [0.050, 0.015, 0.028]),
        ([0.024, 0.0, 0.033], [0.024, 0.045, 0.016]),
        ([0.040, 0.030, 0.036], [0.010, 0.038, 0.010]),
    ] {
        let [from, to] = [from_m, to_m].map(|at_m| Pose::quantise(at_m).unwrap());
        clay.carve(&Sweep {
            shape: ball,
            from,
            to,
        });
    }
    clay
}

pub(crate) fn grid(voxels: [u16; 3]) -> Grid {
    Grid::of_voxels(voxels, 1e-3).unwrap()
}

/// Numbers that a seed decides: SplitMix64.
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    /// From 0 to 1.
    pub(crate) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
