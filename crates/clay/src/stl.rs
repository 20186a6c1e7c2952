//! Binary STL, the format that slicers and mesh viewers read.
//!
//! ```text
//!  0                  80        84
//! +------------------+---------+----------------------------------------------+
//! | header, ASCII    | count   | count times:                                 |
//! | 80 bytes         | u32     |   normal 3 f32, vertices 3 x 3 f32, u16 zero |
//! +------------------+---------+----------------------------------------------+
//! ```
//!
//! Numbers are little-endian. Lengths are in millimetres, as programs that read STL assume. The header says so, and
//! what volume the triangles enclose.

use crate::surface::Mesh;

const HEADER_BYTES: usize = 80;
const TRIANGLE_BYTES: usize = 50;
const MILLIMETRES_PER_METRE: f32 = 1e3;

/// The mesh as a binary STL file, lengths in millimetres.
#[must_use]
pub fn encode(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + 4 + TRIANGLE_BYTES * mesh.triangles.len());
    bytes.extend_from_slice(header(mesh).as_bytes());
    bytes.resize(HEADER_BYTES, b' ');
    bytes.extend_from_slice(&(mesh.triangles.len() as u32).to_le_bytes());
    for triangle in &mesh.triangles {
        let corners = triangle
            .map(|at| mesh.positions_m[at as usize].map(|at_m| at_m * MILLIMETRES_PER_METRE));
        for numbers in [normal(corners)].iter().chain(&corners) {
            for number in numbers {
                bytes.extend_from_slice(&number.to_le_bytes());
            }
        }
        bytes.extend_from_slice(&[0, 0]);
    }
    bytes
}

/// It must not begin with `solid`, by which readers know the text form of STL.
fn header(mesh: &Mesh) -> String {
    // The sum over no triangles is a negative zero.
    let volume_mm3 = 1e9 * mesh.volume_m3() + 0.0;
    format!("binary STL of teleclay, lengths in millimetres, encloses {volume_mm3:.6e} mm3")
}

/// The unit normal of a triangle; zero for one without area, which leaves it to the reader.
fn normal([a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let side = |to: [f32; 3]| -> [f32; 3] { std::array::from_fn(|axis| to[axis] - a[axis]) };
    let (u, v) = (side(b), side(c));
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let length = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
    if length <= 0.0 {
        return [0.0; 3];
    }
    cross.map(|component| component / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_reads_back_in_millimetres() {
        let mesh = Mesh {
            positions_m: vec![[0.0; 3], [0.002, 0.0, 0.0], [0.0, 0.003, 0.0]],
            triangles: vec![[0, 1, 2], [1, 1, 2]],
        };
        let bytes = encode(&mesh);
        assert_eq!(bytes.len(), 84 + 2 * 50);
        assert!(!bytes.starts_with(b"solid"));
        let header = std::str::from_utf8(&bytes[..80]).unwrap();
        assert!(header.is_ascii() && header.contains("encloses 0.000000e0 mm3"));
        assert_eq!(bytes[80..84], 2_u32.to_le_bytes());
        let floats = |from: usize| -> Vec<f32> {
            bytes[from..from + 48]
                .as_chunks::<4>()
                .0
                .iter()
                .map(|b| f32::from_le_bytes(*b))
                .collect()
        };
        let close =
            |got: &[f32], want: &[f32]| got.iter().zip(want).all(|(g, w)| (g - w).abs() < 1e-6);
        assert!(close(
            &floats(84),
            &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0]
        ));
        assert_eq!(bytes[132..134], [0, 0]);
        assert!(
            close(&floats(134)[..3], &[0.0; 3]),
            "no area, no normal, and above all no NaN"
        );
    }

    #[test]
    fn the_header_says_what_is_enclosed() {
        let mesh = Mesh {
            positions_m: vec![[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        };
        let bytes = encode(&mesh);
        let header = std::str::from_utf8(&bytes[..80]).unwrap().trim_end();
        assert!(header.ends_with("encloses 1.000000e10 mm3"), "{header}");
    }

    #[test]
    fn nothing_is_a_valid_file_too() {
        assert_eq!(encode(&Mesh::default()).len(), 84);
    }
}
