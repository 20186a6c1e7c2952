//! Binary glTF 2.0, written: one mesh, one material, smooth normals.
//!
//! ```text
//!  0         4         8         12              20            20 + n                 20 + n + 8
//! +---------+---------+---------+---------------+-------------+----------------------+------------------------+
//! | "glTF"  | 2, u32  | bytes   | n, "JSON"     | JSON, blanks| m, "BIN\0"           | positions, normals,    |
//! |         |         | in all  |               | at its end  |                      | 3 f32 each; u32 indices|
//! +---------+---------+---------+---------------+-------------+----------------------+------------------------+
//! ```
//!
//! Numbers are little-endian, and both chunks are a multiple of four bytes long. Lengths are metres. In glTF, y is up
//! and z comes towards the viewer, in clay z is up: clay's `(x, y, z)` is written as `(x, z, -y)`, a rotation, so
//! triangles stay as they are and every number keeps its bits.

use std::fmt::Write as _;

use teleclay_clay::Mesh;

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// The mesh as a binary glTF file, lengths in metres, y up. Of an empty mesh the file has a scene in which the clay
/// is a node without a mesh.
///
/// # Panics
/// When the file would have more than 4 GiB, sixty times the surface of the largest block.
#[must_use]
pub fn encode(mesh: &Mesh) -> Vec<u8> {
    let mut json = json(mesh).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut numbers = Vec::with_capacity(24 * mesh.positions_m.len() + 12 * mesh.triangles.len());
    let positions_m = mesh.positions_m.iter().map(|at_m| upright(*at_m));
    for number in positions_m.chain(normals(mesh)).flatten() {
        numbers.extend_from_slice(&number.to_le_bytes());
    }
    for index in mesh.triangles.iter().flatten() {
        numbers.extend_from_slice(&index.to_le_bytes());
    }
    let mut chunks = vec![(b"JSON", json)];
    if !numbers.is_empty() {
        chunks.push((b"BIN\0", numbers));
    }
    let bodies: usize = chunks
        .iter()
        .map(|(_, b)| CHUNK_HEADER_BYTES + b.len())
        .sum();
    let total = HEADER_BYTES + bodies;
    let mut bytes = Vec::with_capacity(total);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&length(total));
    for (kind, body) in chunks {
        bytes.extend_from_slice(&length(body.len()));
        bytes.extend_from_slice(kind);
        bytes.extend_from_slice(&body);
    }
    bytes
}

fn length(bytes: usize) -> [u8; 4] {
    u32::try_from(bytes)
        .expect("glTF has at most 4 GiB")
        .to_le_bytes()
}

/// From the clay's frame into that of glTF.
fn upright([x, y, z]: [f32; 3]) -> [f32; 3] {
    // No negative zero where there was none.
    [x, z, 0.0 - y]
}

/// Unit normals of the vertices in the frame of glTF, each the mean of its triangles' by their areas.
fn normals(mesh: &Mesh) -> impl Iterator<Item = [f32; 3]> {
    let mut sums = vec![[0.0_f64; 3]; mesh.positions_m.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|at| mesh.positions_m[at as usize].map(f64::from));
        let side = |to: [f64; 3]| [0, 1, 2].map(|axis| to[axis] - a[axis]);
        let (u, v) = (side(b), side(c));
        // Twice the area long.
        let cross = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        for at in triangle {
            let sum = &mut sums[*at as usize];
            *sum = [0, 1, 2].map(|axis| sum[axis] + cross[axis]);
        }
    }
    sums.into_iter().map(|sum| {
        let length = sum.iter().map(|s| s * s).sum::<f64>().sqrt();
        if 0.0 < length {
            upright(sum.map(|s| (s / length) as f32))
        } else {
            // Of two sides that cancel, or no triangle: glTF wants some unit vector.
            upright([0.0, 0.0, 1.0])
        }
    })
}

/// What the numbers mean.
fn json(mesh: &Mesh) -> String {
    let mut json = String::from(r#"{"asset":{"version":"2.0","generator":"teleclay"},"scene":0,"#);
    let vertices = mesh.positions_m.len();
    let indices = 3 * mesh.triangles.len();
    if vertices == 0 || indices == 0 {
        json.push_str(r#""scenes":[{"nodes":[0]}],"nodes":[{"name":"clay"}]}"#);
        return json;
    }
    let positions_m = || mesh.positions_m.iter().map(|at_m| upright(*at_m));
    let bound = |of: fn(f32, f32) -> f32| {
        let bound = positions_m().reduce(|a, b| [0, 1, 2].map(|axis| of(a[axis], b[axis])));
        // As wide numbers, whose decimals are exactly these.
        bound.unwrap_or_default().map(f64::from)
    };
    let (lower, upper) = (bound(f32::min), bound(f32::max));
    let column = 12 * vertices;
    let index_bytes = 4 * indices;
    let all = 2 * column + index_bytes;
    // 34962 is a buffer of vertices, 34963 one of indices; 5126 is f32, 5125 u32.
    let written = write!(
        json,
        concat!(
            r#""scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"clay"}}],"#,
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1}},"indices":2,"material":0}}]}}],"#,
            r#""materials":[{{"name":"clay","pbrMetallicRoughness":"#,
            r#"{{"baseColorFactor":[0.46,0.25,0.16,1],"metallicFactor":0,"roughnessFactor":0.9}}}}],"#,
            r#""buffers":[{{"byteLength":{all}}}],"bufferViews":["#,
            r#"{{"buffer":0,"byteOffset":0,"byteLength":{column},"target":34962}},"#,
            r#"{{"buffer":0,"byteOffset":{column},"byteLength":{column},"target":34962}},"#,
            r#"{{"buffer":0,"byteOffset":{index_offset},"byteLength":{index_bytes},"target":34963}}],"#,
            r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","#,
            r#""min":{lower:?},"max":{upper:?}}},"#,
            r#"{{"bufferView":1,"componentType":5126,"count":{vertices},"type":"VEC3"}},"#,
            r#"{{"bufferView":2,"componentType":5125,"count":{indices},"type":"SCALAR"}}]}}"#,
        ),
        all = all,
        column = column,
        index_offset = 2 * column,
        index_bytes = index_bytes,
        vertices = vertices,
        lower = lower,
        upper = upper,
        indices = indices,
    );
    written.expect("a string takes what is written to it");
    json
}
