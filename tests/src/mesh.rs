//! A binary STL file: its volume, and whether it is a closed manifold. Reads the file format alone, so it is
//! independent of what wrote it.

use std::collections::HashMap;

use anyhow::{Result, ensure};

/// What a mesh is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Audit {
    /// Number of triangles.
    pub triangles: usize,
    /// Edges that do not belong to exactly two triangles which pass them in opposite directions: none in a closed
    /// manifold.
    pub open_edges: usize,
    /// Volume inside, by the divergence theorem, in the file's unit cubed; below zero when faces look inwards.
    pub volume: f64,
}

/// Reads a binary STL file.
///
/// # Errors
/// It is none.
pub fn audit(stl: &[u8]) -> Result<Audit> {
    const HEADER: usize = 80;
    const FACET: usize = 50;
    ensure!(
        HEADER + 4 <= stl.len(),
        "{} bytes are too few for a header",
        stl.len()
    );
    let count = u32::from_le_bytes(stl[HEADER..HEADER + 4].try_into()?) as usize;
    ensure!(
        stl.len() == HEADER + 4 + FACET * count,
        "{} bytes do not hold {count} triangles",
        stl.len()
    );
    // How often an edge is passed one way, and how often the other.
    let mut edges: HashMap<[[u32; 3]; 2], [usize; 2]> = HashMap::with_capacity(3 * count);
    let mut six_volumes = 0.0;
    for facet in stl[HEADER + 4..].chunks_exact(FACET) {
        let number = |index: usize| {
            let at = 4 * index;
            f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]])
        };
        // Twelve numbers: the normal, then three corners.
        let corner =
            |index: usize| -> [f32; 3] { std::array::from_fn(|axis| number(3 + 3 * index + axis)) };
        let corners: [[f32; 3]; 3] = std::array::from_fn(corner);
        ensure!(
            corners.iter().flatten().all(|value| value.is_finite()),
            "a corner is not finite"
        );
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (from, to) = (key(corners[from]), key(corners[to]));
            edges.entry([from.min(to), from.max(to)]).or_default()[usize::from(to < from)] += 1;
        }
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        six_volumes += a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    Ok(Audit {
        triangles: count,
        open_edges: edges.values().filter(|&&passed| passed != [1, 1]).count(),
        volume: six_volumes / 6.0,
    })
}

/// A corner as its bits; the two zeros are one place.
fn key(corner: [f32; 3]) -> [u32; 3] {
    corner.map(|value| (value + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron with the corners 0, x, y, z, faces looking outwards; without its last face when it is open.
    fn tetrahedron(faces: usize) -> Vec<u8> {
        let [o, x, y, z] = [
            [0.0_f32; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        ];
        let all = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]];
        let mut stl = vec![0; 80];
        stl.extend((faces as u32).to_le_bytes());
        for face in &all[..faces] {
            stl.extend([0; 12]);
            stl.extend(face.iter().flatten().flat_map(|value| value.to_le_bytes()));
            stl.extend([0; 2]);
        }
        stl
    }

    #[test]
    fn a_tetrahedron_is_closed_and_has_a_sixth() {
        let audit = audit(&tetrahedron(4)).unwrap();
        assert_eq!((audit.triangles, audit.open_edges), (4, 0));
        assert!((audit.volume - 1.0 / 6.0).abs() < 1e-12, "{audit:?}");
    }

    #[test]
    fn an_edge_of_four_triangles_is_found() {
        let one = tetrahedron(4);
        // The same again on the other side of the edge along z.
        let mut stl = one.clone();
        stl[80..84].copy_from_slice(&8_u32.to_le_bytes());
        for facet in one[84..].chunks_exact(50) {
            let mut facet = facet.to_vec();
            for corner in [12, 24, 36] {
                for axis in [0, 4] {
                    // x and y change their sign: their highest bit.
                    facet[corner + axis + 3] ^= 0x80;
                }
            }
            stl.extend(facet);
        }
        let audit = audit(&stl).unwrap();
        assert_eq!((audit.triangles, audit.open_edges), (8, 1));
        assert!((audit.volume - 1.0 / 3.0).abs() < 1e-12, "{audit:?}");
    }

    #[test]
    fn a_missing_face_leaves_three_open_edges_and_half_a_file_is_none() {
        assert_eq!(audit(&tetrahedron(3)).unwrap().open_edges, 3);
        let whole = tetrahedron(4);
        assert!(audit(&whole[..whole.len() - 1]).is_err());
    }
}
