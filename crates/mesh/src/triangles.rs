//! A closed mesh.
//!
//! *Welded:* vertices at the same place, to the last bit, are one. Triangles that name a vertex twice are dropped then:
//! they pass an edge both ways, so nothing depends on them. Triangles without area that name three vertices are kept,
//! since they close the gap between their neighbours.
//!
//! *Closed:* along every edge, triangles pass as often one way as the other. In a two-manifold these are one and one.
//! Where bodies touch along an edge or a face there may be more, and they still enclose something; what is refused is
//! an edge at which a triangle ends, or two neighbours that face opposite ways.
//!
//! *Facing outwards:* a mesh that is inside out, that is, of negative volume, is turned round as a whole. Its parts are
//! not: a shell within another that faces inwards is a hollow.

use crate::error::{Format, MeshError};

/// Most triangles of a mesh, and three times as many vertices: a ring that fills a grid of 512 by 512 by 256 has 1.7
/// million on its surface, and no grid shows more detail.
pub const MOST_TRIANGLES: usize = 2_000_000;
/// Farthest that a vertex may be from the origin along an axis, m. So far, squares and cubes of lengths are exact
/// enough; whatever needs more is in the wrong unit.
pub const MOST_COORDINATE_M: f64 = 1e5;
/// A bounding box with a thinner side than this encloses nothing, m.
const LEAST_EXTENT_M: f64 = 1e-9;

/// A closed mesh. Invariant: welded, at least one triangle, none that names a vertex twice, every edge in balance,
/// every vertex finite and in use, volume not negative.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    vertices_m: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// A mesh of these vertices, m, and triangles of three vertex numbers each, counter-clockwise seen from outside.
    ///
    /// # Errors
    /// When a number is not finite, out of range or of no vertex, or the mesh has too many triangles, is not closed or
    /// encloses nothing.
    ///
    /// ```
    /// use teleclay_mesh::{MeshError, TriangleMesh};
    ///
    /// let vertices_m = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
    /// let sides = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    /// let mesh = TriangleMesh::new(vertices_m.clone(), sides.clone())?;
    /// assert!((mesh.volume_m3() - 0.001 / 6.0).abs() < 1e-18);
    ///
    /// let open = TriangleMesh::new(vertices_m, sides[..3].to_vec());
    /// assert_eq!(open, Err(MeshError::Open { open_edges: 3 }));
    /// # Ok::<(), MeshError>(())
    /// ```
    pub fn new(
        mut vertices_m: Vec<[f64; 3]>,
        mut triangles: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        check_counts(vertices_m.len(), &triangles)?;
        for (vertex, at_m) in vertices_m.iter_mut().enumerate() {
            let got_m = *at_m;
            // A NaN is not in range either.
            if !got_m.iter().all(|at| at.abs() <= MOST_COORDINATE_M) {
                return Err(MeshError::OutOfRange {
                    vertex,
                    got_m,
                    most_m: MOST_COORDINATE_M,
                });
            }
            // Two zeros of different signs are the same place.
            *at_m = got_m.map(|at| at + 0.0);
        }
        weld(&mut vertices_m, &mut triangles);
        let open_edges = open_edges(&triangles);
        if 0 < open_edges {
            return Err(MeshError::Open { open_edges });
        }
        let mut mesh = Self {
            vertices_m,
            triangles,
        };
        let (lower_m, upper_m) = mesh.bounds_m();
        if (0..3).any(|axis| upper_m[axis] - lower_m[axis] < LEAST_EXTENT_M) {
            return Err(MeshError::Empty);
        }
        if mesh.volume_m3() < 0.0 {
            for triangle in &mut mesh.triangles {
                triangle.swap(1, 2);
            }
        }
        Ok(mesh)
    }

    /// The vertices, m, in the order in which triangles name them first.
    #[must_use]
    pub fn vertices_m(&self) -> &[[f64; 3]] {
        &self.vertices_m
    }

    /// Vertex numbers of each triangle, counter-clockwise seen from outside.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Lower and upper corner of the bounding box, m.
    #[must_use]
    pub fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for at_m in &self.vertices_m {
            for axis in 0..3 {
                lower[axis] = lower[axis].min(at_m[axis]);
                upper[axis] = upper[axis].max(at_m[axis]);
            }
        }
        (lower, upper)
    }

    /// Volume that the mesh encloses, m³, by the divergence theorem. Where shells overlap, each counts.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        // From the mesh's own corner: far from the origin, large volumes would cancel.
        let (lower_m, _) = self.bounds_m();
        let six_volumes: f64 = self
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|at| {
                    let at_m = self.vertices_m[at as usize];
                    [0, 1, 2].map(|axis| at_m[axis] - lower_m[axis])
                });
                a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
            })
            .sum();
        six_volumes / 6.0
    }
}

impl TryFrom<&teleclay_clay::Mesh> for TriangleMesh {
    type Error = MeshError;

    /// The surface of clay. Empty for clay that is all gone.
    fn try_from(mesh: &teleclay_clay::Mesh) -> Result<Self, MeshError> {
        let vertices_m = mesh.positions_m.iter().map(|at_m| at_m.map(f64::from));
        Self::new(vertices_m.collect(), mesh.triangles.clone())
    }
}

/// Refuses more than is read, and triangles that name a vertex which is not there.
fn check_counts(vertices: usize, triangles: &[[u32; 3]]) -> Result<(), MeshError> {
    for (what, got, most) in [
        ("triangles", triangles.len(), MOST_TRIANGLES),
        ("vertices", vertices, 3 * MOST_TRIANGLES),
    ] {
        if most < got {
            return Err(MeshError::TooMuch {
                format: Format::Mesh,
                what,
                got: got as u64,
                most: most as u64,
            });
        }
    }
    let named = triangles.iter().flatten().max();
    if let Some(&named) = named.filter(|named| vertices <= **named as usize) {
        return Err(MeshError::SelfContradicting {
            format: Format::Mesh,
            what: "vertices",
            said: u64::from(named) + 1,
            found: vertices as u64,
        });
    }
    Ok(())
}

/// Makes vertices at the same place one, drops triangles that name one twice, and then vertices that none names.
fn weld(vertices_m: &mut Vec<[f64; 3]>, triangles: &mut Vec<[u32; 3]>) {
    // Sorted, places that are the same are neighbours, the first of them in front: the order of the file decides, and
    // no hash.
    let mut order: Vec<u32> = (0..vertices_m.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| {
        let (at_a, at_b) = (&vertices_m[a as usize], &vertices_m[b as usize]);
        let places = at_a.iter().zip(at_b);
        let places = places.map(|(a, b)| a.total_cmp(b));
        places
            .fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
            .then(a.cmp(&b))
    });
    let mut first = vec![0; vertices_m.len()];
    let mut before: Option<u32> = None;
    for &vertex in &order {
        let same = before.filter(|&before| {
            let bits = |vertex: u32| vertices_m[vertex as usize].map(f64::to_bits);
            bits(before) == bits(vertex)
        });
        let place = same.unwrap_or(vertex);
        first[vertex as usize] = place;
        before = Some(place);
    }
    triangles.retain_mut(|triangle| {
        *triangle = triangle.map(|vertex| first[vertex as usize]);
        let [a, b, c] = *triangle;
        a != b && b != c && c != a
    });
    // What was the order has served; it becomes the new numbers of the vertices.
    let mut number = order;
    number.fill(u32::MAX);
    let mut kept = Vec::new();
    for vertex in triangles.iter_mut().flatten() {
        let number = &mut number[*vertex as usize];
        if *number == u32::MAX {
            *number = kept.len() as u32;
            kept.push(vertices_m[*vertex as usize]);
        }
        *vertex = *number;
    }
    *vertices_m = kept;
}

/// Edges along which triangles do not pass as often one way as the other.
fn open_edges(triangles: &[[u32; 3]]) -> usize {
    // The lower vertex in the upper half, the other one above a bit for the direction: six million need 23 bits.
    let passes = triangles.iter().flat_map(|&[a, b, c]| {
        [(a, b), (b, c), (c, a)].map(|(from, to)| {
            let (low, high) = (from.min(to), from.max(to));
            u64::from(low) << 32 | u64::from(high) << 1 | u64::from(to < from)
        })
    });
    let mut passes: Vec<u64> = passes.collect();
    passes.sort_unstable();
    passes
        .chunk_by(|a, b| a >> 1 == b >> 1)
        .filter(|edge| {
            let back = edge.iter().filter(|&pass| pass & 1 == 1).count();
            2 * back != edge.len()
        })
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    fn corners() -> Vec<[f64; 3]> {
        vec![
            [0.0; 3],
            [0.01, 0.0, 0.0],
            [0.0, 0.02, 0.0],
            [0.0, 0.0, 0.03],
        ]
    }

    #[test]
    fn a_soup_of_triangles_is_welded_in_the_order_of_the_file() {
        let indexed = TriangleMesh::new(corners(), TETRAHEDRON.to_vec()).unwrap();
        let soup: Vec<[f64; 3]> = TETRAHEDRON
            .iter()
            .flatten()
            .map(|&at| corners()[at as usize].map(|at| if at == 0.0 { -0.0 } else { at }))
            .collect();
        let triangles = (0..4).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let welded = TriangleMesh::new(soup, triangles).unwrap();
        assert_eq!(welded, indexed);
        assert_eq!(welded.vertices_m().len(), 4);
        assert_eq!(format!("{:?}", welded.vertices_m()[1]), "[0.0, 0.02, 0.0]");
    }

    #[test]
    fn a_mesh_inside_out_is_turned_round() {
        let turned = TETRAHEDRON.map(|[a, b, c]| [a, c, b]).to_vec();
        let mesh = TriangleMesh::new(corners(), turned).unwrap();
        assert_eq!(mesh.volume_m3().to_bits(), {
            let outside = TriangleMesh::new(corners(), TETRAHEDRON.to_vec()).unwrap();
            outside.volume_m3().to_bits()
        });
        assert!((mesh.volume_m3() - 1e-6).abs() < 1e-18);
    }

    #[test]
    fn what_no_triangle_names_is_no_part_of_the_mesh() {
        let mut vertices = corners();
        vertices.push([5.0; 3]);
        let mut triangles = TETRAHEDRON.to_vec();
        triangles.push([4, 4, 1]);
        let mesh = TriangleMesh::new(vertices, triangles).unwrap();
        assert_eq!(mesh.bounds_m(), ([0.0; 3], [0.01, 0.02, 0.03]));
        assert_eq!(mesh.triangles().len(), 4);
    }

    #[test]
    fn nonsense_is_refused() {
        let with = |vertex: [f64; 3], triangles: &[[u32; 3]]| {
            let mut vertices = corners();
            vertices[2] = vertex;
            TriangleMesh::new(vertices, triangles.to_vec())
        };
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e6, -1e300] {
            assert!(matches!(
                with([0.0, wrong, 0.0], &TETRAHEDRON),
                Err(MeshError::OutOfRange { vertex: 2, .. })
            ));
        }
        let contradicting = with([0.0, 0.02, 0.0], &[[0, 1, 4]]).unwrap_err();
        assert_eq!(
            contradicting.to_string(),
            "mesh speaks of 5 vertices, there are 4"
        );
        assert_eq!(with([0.0, 0.02, 0.0], &[]), Err(MeshError::Empty));
        assert_eq!(
            with([0.02, 0.0, 0.0], &TETRAHEDRON),
            Err(MeshError::Empty),
            "flat along y"
        );
        let flap = [[0, 1, 2], [0, 2, 1]];
        assert_eq!(with([0.0, 0.02, 0.0], &flap), Err(MeshError::Empty));
    }

    #[test]
    fn too_many_triangles_are_refused() {
        let many = vec![[0, 1, 2]; MOST_TRIANGLES + 1];
        assert!(matches!(
            TriangleMesh::new(corners(), many),
            Err(MeshError::TooMuch {
                what: "triangles",
                ..
            })
        ));
    }
}
