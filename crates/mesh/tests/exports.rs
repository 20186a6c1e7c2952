//! What is written, read by others: the archive by hand, XML by `roxmltree`, glTF as its specification has it, with
//! `serde_json`.

mod archive;
mod shapes;

use roxmltree::{Document, Node};
use serde_json::{Value, json};
use teleclay_clay::{Clay, Mesh, Shape, UNITS_PER_VOXEL};
use teleclay_mesh::{MeshError, TriangleMesh, glb, read_3mf, threemf};

use archive::{CONTENT_TYPES, MODEL, RELATIONSHIPS, unpacked};
use shapes::carved;

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
const PACKAGE: &str = "http://schemas.openxmlformats.org/package/2006";

fn text(parts: &[(String, Vec<u8>)], name: &str) -> String {
    let mut found = parts.iter().filter(|(other, _)| other == name);
    let (_, content) = found.next().unwrap();
    assert!(found.next().is_none());
    String::from_utf8(content.clone()).unwrap()
}

fn only<'a, 'i>(parent: Node<'a, 'i>, name: &'static str) -> Node<'a, 'i> {
    let children: Vec<_> = parent
        .children()
        .filter(|c| c.has_tag_name((CORE, name)))
        .collect();
    assert_eq!(children.len(), 1, "{name}");
    children[0]
}

#[test]
fn a_package_has_the_parts_that_its_conventions_ask_for() {
    let parts = unpacked(&threemf::encode(&Mesh::of(&carved())));
    let names: Vec<&str> = parts.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, [CONTENT_TYPES, RELATIONSHIPS, MODEL]);

    let types = text(&parts, CONTENT_TYPES);
    let types = Document::parse(&types).unwrap();
    assert!(
        types
            .root_element()
            .has_tag_name((&*format!("{PACKAGE}/content-types"), "Types"))
    );
    let kind_of = |extension: &str| {
        let mut kinds = types.root_element().children().filter(|kind| {
            kind.has_tag_name((&*format!("{PACKAGE}/content-types"), "Default"))
                && kind.attribute("Extension") == Some(extension)
        });
        kinds
            .next()
            .and_then(|kind| kind.attribute("ContentType"))
            .map(str::to_owned)
    };
    assert_eq!(
        kind_of("rels").as_deref(),
        Some("application/vnd.openxmlformats-package.relationships+xml")
    );
    assert_eq!(
        kind_of("model").as_deref(),
        Some("application/vnd.ms-package.3dmanufacturing-3dmodel+xml")
    );

    let relationships = text(&parts, RELATIONSHIPS);
    let relationships = Document::parse(&relationships).unwrap();
    let to_model: Vec<_> = relationships
        .root_element()
        .children()
        .filter(Node::is_element)
        .collect();
    assert_eq!(to_model.len(), 1);
    assert!(to_model[0].has_tag_name((&*format!("{PACKAGE}/relationships"), "Relationship")));
    assert_eq!(to_model[0].attribute("Target"), Some("/3D/3dmodel.model"));
    assert_eq!(
        to_model[0].attribute("Type"),
        Some("http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel")
    );
    assert!(to_model[0].attribute("Id").is_some());
}

/// The mesh of a package, read by `roxmltree`.
fn model(package: &[u8]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let text = text(&unpacked(package), MODEL);
    let document = Document::parse(&text).unwrap();
    let model = document.root_element();
    assert!(model.has_tag_name((CORE, "model")));
    assert_eq!(model.attribute("unit"), Some("millimeter"));
    let object = only(only(model, "resources"), "object");
    let item = only(only(model, "build"), "item");
    assert_eq!(item.attribute("objectid"), object.attribute("id"));
    assert_eq!(item.attribute("transform"), None);
    let mesh = only(object, "mesh");
    let numbers = |node: Node<'_, '_>, names: [&str; 3]| -> [f64; 3] {
        names.map(|name| node.attribute(name).unwrap().parse().unwrap())
    };
    let vertices = only(mesh, "vertices").children().filter(Node::is_element);
    let triangles = only(mesh, "triangles").children().filter(Node::is_element);
    (
        vertices
            .map(|node| numbers(node, ["x", "y", "z"]))
            .collect(),
        triangles
            .map(|node| numbers(node, ["v1", "v2", "v3"]).map(|at| at as u32))
            .collect(),
    )
}

#[test]
fn a_package_holds_the_clays_surface_in_millimetres() {
    let clay = carved();
    let surface = Mesh::of(&clay);
    let (vertices_mm, triangles) = model(&threemf::encode(&surface));
    assert_eq!(triangles, surface.triangles);
    for (got_mm, want_m) in vertices_mm.iter().zip(&surface.positions_m) {
        for axis in 0..3 {
            assert_eq!(
                (got_mm[axis] as f32).to_bits(),
                (want_m[axis] * 1e3).to_bits()
            );
        }
    }
    let vertices_m = vertices_mm
        .iter()
        .map(|at_mm| at_mm.map(|at| at * 1e-3))
        .collect();
    let mesh = TriangleMesh::new(vertices_m, triangles).unwrap();
    assert!((mesh.volume_m3() / clay.remaining_volume_m3() - 1.0).abs() < 1.1e-3);
    assert_eq!(mesh.triangles().len(), surface.triangles.len());
}

#[test]
fn our_own_reader_reads_the_same() {
    let clay = carved();
    let package = threemf::encode(&Mesh::of(&clay));
    let (vertices_mm, triangles) = model(&package);
    let vertices_m = vertices_mm
        .iter()
        .map(|at_mm| at_mm.map(|at| at * 1e-3))
        .collect();
    assert_eq!(read_3mf(&package), TriangleMesh::new(vertices_m, triangles));
}

#[test]
fn of_clay_that_is_gone_a_package_builds_nothing() {
    let package = threemf::encode(&Mesh::default());
    let text = text(&unpacked(&package), MODEL);
    let document = Document::parse(&text).unwrap();
    let model = document.root_element();
    assert_eq!(only(model, "resources").children().count(), 0);
    assert_eq!(only(model, "build").children().count(), 0);
    assert_eq!(read_3mf(&package), Err(MeshError::Empty));
}

/// What a binary glTF holds.
struct Scene {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// The two chunks of a binary glTF, section 4.4 of its specification; the second one may be missing.
fn chunks(bytes: &[u8]) -> (Value, &[u8]) {
    let long = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(
        (&bytes[..4], long(4), long(8)),
        (&b"glTF"[..], 2, bytes.len())
    );
    let json = long(12);
    assert_eq!((&bytes[16..20], json % 4), (&b"JSON"[..], 0));
    assert!(
        matches!(bytes[20 + json - 1], b'}' | b' '),
        "padded with blanks"
    );
    let value = serde_json::from_slice(&bytes[20..20 + json]).unwrap();
    let rest = &bytes[20 + json..];
    if rest.is_empty() {
        return (value, rest);
    }
    let binary = long(20 + json);
    assert_eq!((&rest[4..8], binary % 4), (&b"BIN\0"[..], 0));
    assert_eq!(8 + binary, rest.len());
    (value, &rest[8..])
}

fn number(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

/// The elements of an accessor, each of four bytes, three at a time.
fn elements(gltf: &Value, binary: &[u8], accessor: &Value, target: usize) -> Vec<[[u8; 4]; 3]> {
    let accessor = &gltf["accessors"][number(accessor)];
    let view = &gltf["bufferViews"][number(&accessor["bufferView"])];
    assert_eq!(
        (&view["buffer"], &view["target"]),
        (&json!(0), &json!(target))
    );
    assert_eq!(
        (&view["byteStride"], &accessor["byteOffset"]),
        (&Value::Null, &Value::Null)
    );
    let (from, length) = (number(&view["byteOffset"]), number(&view["byteLength"]));
    let width = if accessor["type"] == "VEC3" { 12 } else { 4 };
    assert_eq!((from % 4, length), (0, width * number(&accessor["count"])));
    let (words, rest) = binary[from..from + length].as_chunks::<4>();
    assert!(rest.is_empty() && words.len() % 3 == 0);
    words.as_chunks::<3>().0.to_vec()
}

fn scene(bytes: &[u8]) -> Scene {
    const VERTICES: usize = 34962;
    const INDICES: usize = 34963;
    let (gltf, binary) = chunks(bytes);
    assert_eq!(gltf["asset"]["version"], "2.0");
    assert_eq!(gltf["buffers"], json!([{ "byteLength": binary.len() }]));
    let root = &gltf["scenes"][number(&gltf["scene"])]["nodes"];
    assert_eq!(root.as_array().unwrap().len(), 1);
    let node = &gltf["nodes"][number(&root[0])];
    for untouched in ["matrix", "rotation", "translation", "scale"] {
        assert_eq!(node[untouched], Value::Null);
    }
    let primitives = gltf["meshes"][number(&node["mesh"])]["primitives"]
        .as_array()
        .unwrap();
    assert_eq!(primitives.len(), 1);
    // Triangles, 4, is what a primitive is if it does not say.
    assert!(primitives[0]["mode"].is_null() || primitives[0]["mode"] == 4);
    let material = &gltf["materials"][number(&primitives[0]["material"])];
    assert_eq!(
        material["pbrMetallicRoughness"]["baseColorFactor"]
            .as_array()
            .unwrap()
            .len(),
        4
    );

    let attributes = &primitives[0]["attributes"];
    let vectors = |name: &str| -> Vec<[f32; 3]> {
        let accessor = &gltf["accessors"][number(&attributes[name])];
        assert_eq!(
            (&accessor["componentType"], &accessor["type"]),
            (&json!(5126), &json!("VEC3"))
        );
        let elements = elements(&gltf, binary, &attributes[name], VERTICES);
        elements
            .iter()
            .map(|vector| vector.map(f32::from_le_bytes))
            .collect()
    };
    let (positions, normals) = (vectors("POSITION"), vectors("NORMAL"));
    assert_eq!(positions.len(), normals.len());
    let indices = &primitives[0]["indices"];
    let accessor = &gltf["accessors"][number(indices)];
    assert_eq!(
        (&accessor["componentType"], &accessor["type"]),
        (&json!(5125), &json!("SCALAR"))
    );
    let triangles = elements(&gltf, binary, indices, INDICES);
    let triangles: Vec<_> = triangles
        .iter()
        .map(|t| t.map(u32::from_le_bytes))
        .collect();
    assert!(
        triangles
            .iter()
            .flatten()
            .all(|&at| (at as usize) < positions.len())
    );

    // The bounds are exactly those of the positions.
    let bound = &gltf["accessors"][number(&attributes["POSITION"])];
    for axis in 0..3 {
        let along = || positions.iter().map(|at| at[axis]);
        for (name, want) in [
            ("min", along().fold(f32::INFINITY, f32::min)),
            ("max", along().fold(f32::NEG_INFINITY, f32::max)),
        ] {
            let got = bound[name][axis].as_f64().unwrap();
            assert_eq!(got.to_bits(), f64::from(want).to_bits(), "{name} {axis}");
        }
    }
    Scene {
        positions,
        normals,
        triangles,
    }
}

#[test]
fn a_scene_holds_the_clays_surface_in_metres_with_y_up() {
    let clay = carved();
    let surface = Mesh::of(&clay);
    let Scene {
        positions,
        normals,
        triangles,
    } = scene(&glb::encode(&surface));
    assert_eq!(triangles, surface.triangles);
    for (got_m, want_m) in positions.iter().zip(&surface.positions_m) {
        let [right, up, to_viewer] = got_m.map(f64::from);
        let [x, y, z] = want_m.map(f64::from);
        assert!((right - x).abs() + (up - z).abs() + (to_viewer + y).abs() <= 0.0);
    }
    let vertices_m: Vec<_> = positions.iter().map(|at| at.map(f64::from)).collect();
    let six_volumes: f64 = triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|at| vertices_m[at as usize]);
            a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
        })
        .sum();
    let share = six_volumes / 6.0 / clay.remaining_volume_m3();
    assert!((share - 1.0).abs() < 1.1e-3, "and not inside out: {share}");
    assert!(TriangleMesh::new(vertices_m, triangles).is_ok(), "closed");
    for normal in normals {
        let length: f32 = normal.iter().map(|n| n * n).sum();
        assert!((length - 1.0).abs() < 1e-5);
    }
}

#[test]
fn normals_point_away_from_a_ball_of_clay() {
    let parts = shapes::ball(0.012, 5).shifted([0.015; 3]);
    let mesh = parts.mesh().unwrap();
    let grid = shapes::grid([30; 3]);
    let clay = teleclay_mesh::fill(&mesh, &grid, teleclay_mesh::Placement::AsIs).unwrap();
    let Scene {
        positions, normals, ..
    } = scene(&glb::encode(&Mesh::of(&clay)));
    for (at_m, normal) in positions.iter().zip(&normals) {
        let out = [at_m[0] - 0.015, at_m[1] - 0.015, at_m[2] + 0.015];
        let length = out.iter().map(|o| o * o).sum::<f32>().sqrt();
        let cosine = (0..3).map(|axis| out[axis] * normal[axis]).sum::<f32>() / length;
        assert!(0.97 < cosine, "{at_m:?}: {cosine}");
    }
}

/// Whatever its numbers come to in decimals, the text is padded.
#[test]
fn the_chunks_of_a_scene_are_padded_and_add_up() {
    let mut remainders = [false; 4];
    for length in 1..30_u8 {
        let size_m = [0.001 * f64::from(length), 0.004, 0.004];
        let clay = Clay::new(&Shape::Block { size_m }, 1e-3).unwrap();
        let bytes = glb::encode(&Mesh::of(&clay));
        let (gltf, _) = chunks(&bytes);
        assert_eq!(gltf["asset"]["generator"], "teleclay");
        let blanks = bytes[..]
            .windows(9)
            .position(|at| at.ends_with(b"BIN\0"))
            .unwrap();
        let padded = bytes[..blanks]
            .iter()
            .rev()
            .skip_while(|b| **b != b' ' && **b != b'}');
        remainders[padded.take_while(|b| **b == b' ').count()] = true;
    }
    assert!(
        1 < remainders.iter().filter(|seen| **seen).count(),
        "{remainders:?}"
    );
}

#[test]
fn of_clay_that_is_gone_a_scene_is_empty() {
    let bytes = glb::encode(&Mesh::default());
    let (gltf, binary) = chunks(&bytes);
    assert!(binary.is_empty());
    let root = &gltf["scenes"][number(&gltf["scene"])]["nodes"];
    let node = &gltf["nodes"][number(&root[0])];
    assert!(node.is_object() && node["mesh"].is_null());
    for list in ["meshes", "buffers", "bufferViews", "accessors"] {
        assert!(gltf[list].is_null(), "an empty list is not allowed");
    }
}

#[test]
fn the_same_clay_is_the_same_file() {
    let size_m = [0.020, 0.012, 0.016];
    let clay = || Mesh::of(&Clay::new(&Shape::Block { size_m }, 1e-3).unwrap());
    assert_eq!(threemf::encode(&clay()), threemf::encode(&clay()));
    assert_eq!(glb::encode(&clay()), glb::encode(&clay()));
    let mesh = read_3mf(&threemf::encode(&clay())).unwrap();
    let units = (mesh.volume_m3() / 1e-9 * UNITS_PER_VOXEL as f64).round() as u64;
    assert_eq!(units, 20 * 12 * 16 * 255, "a block has sharp edges");
}
