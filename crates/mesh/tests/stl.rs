//! STL files as they come: whole ones in both forms, and everything that can be wrong with one.

mod shapes;

use teleclay_clay::{Mesh, stl};
use teleclay_mesh::{Format, MeshError, TriangleMesh, read_stl};

use shapes::{Parts, ball, carved, cuboid, tetrahedron, torus};

fn box_of_a_centimetre() -> Parts {
    cuboid([0.0; 3], [0.010; 3])
}

fn refused(bytes: &[u8]) -> String {
    read_stl(bytes)
        .expect_err("it should be refused")
        .to_string()
}

#[test]
fn numbers_are_millimetres_in_both_forms() {
    for parts in [
        box_of_a_centimetre(),
        tetrahedron([0.010, 0.020, 0.030]),
        ball(0.012, 3),
        torus(0.020, 0.005, 24, 12),
    ] {
        let wanted = parts.mesh().unwrap();
        let binary = read_stl(&parts.binary_stl()).unwrap();
        let text = read_stl(parts.text_stl().as_bytes()).unwrap();
        for mesh in [binary, text] {
            assert_eq!(mesh.triangles(), wanted.triangles());
            for (got_m, want_m) in mesh.vertices_m().iter().zip(wanted.vertices_m()) {
                let is_close = (0..3).all(|axis| (got_m[axis] - want_m[axis]).abs() < 1e-8);
                assert!(is_close, "{got_m:?} {want_m:?}");
            }
        }
    }
}

#[test]
fn the_clays_own_file_is_its_surface_again() {
    let clay = carved();
    let surface = Mesh::of(&clay);
    let mesh = read_stl(&stl::encode(&surface)).unwrap();
    assert_eq!(mesh.triangles().len(), surface.triangles.len());
    assert_eq!(mesh.vertices_m().len(), surface.positions_m.len());
    assert!((mesh.volume_m3() / clay.remaining_volume_m3() - 1.0).abs() < 1.1e-3);
    assert_eq!(
        read_stl(&stl::encode(&Mesh::default())),
        Err(MeshError::Empty)
    );
}

#[test]
fn text_may_be_written_in_many_ways() {
    let parts = box_of_a_centimetre();
    let wanted = read_stl(parts.text_stl().as_bytes()).unwrap();
    let text = parts.text_stl();
    let lines: Vec<&str> = text.lines().collect();
    let half = lines.len() / 2 / 7 * 7 + 1;
    let two_solids = format!(
        "{}\nendsolid\n\n solid second\n{}\n",
        lines[..half].join("\n"),
        lines[half..].join("\n")
    );
    for other in [
        text.to_uppercase(),
        text.replace('\n', "\r\n"),
        text.replace('\n', "\r"),
        text.replace(' ', "  \t "),
        format!("\n  {text}\n\n"),
        text.replace("solid a name of words", "solid"),
        text.replace("normal 0 0 0", "normal nan -nan inf"),
        two_solids,
    ] {
        assert_eq!(read_stl(other.as_bytes()).unwrap(), wanted, "{other}");
    }
}

/// Some programs do.
#[test]
fn a_binary_file_may_begin_as_text_does() {
    let parts = box_of_a_centimetre();
    let mut bytes = parts.binary_stl();
    bytes[..5].copy_from_slice(b"solid");
    assert_eq!(read_stl(&bytes), read_stl(&parts.binary_stl()));
    bytes.pop();
    assert_eq!(
        refused(&bytes),
        "binary STL speaks of 12 triangles, there are 11"
    );
}

#[test]
fn a_binary_file_that_is_cut_short_or_goes_on_is_refused() {
    let whole = box_of_a_centimetre().binary_stl();
    for length in 0..whole.len() {
        let error = read_stl(&whole[..length]).expect_err("it is cut short");
        assert!(
            matches!(
                error,
                MeshError::SelfContradicting {
                    format: Format::BinaryStl,
                    ..
                }
            ),
            "{length}: {error}"
        );
    }
    assert_eq!(
        refused(&whole[..84 + 3 * 50 + 7]),
        "binary STL speaks of 12 triangles, there are 3"
    );
    assert_eq!(
        refused(&whole[..9]),
        "binary STL speaks of 84 bytes of a header, there are 9"
    );
    let longer = [&whole[..], b"junk"].concat();
    assert_eq!(
        refused(&longer),
        "binary STL, byte 684: 4 more bytes after the last of 12 triangles"
    );
    let another = [&whole[..], &whole[84..134]].concat();
    assert_eq!(
        refused(&another),
        "binary STL speaks of 12 triangles, there are 13"
    );
}

#[test]
fn a_count_that_is_not_so_is_refused() {
    let counted = |count: u32| {
        let mut bytes = box_of_a_centimetre().binary_stl();
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        refused(&bytes)
    };
    for count in [0, 11, 13, 0x8000_0000, -12_i32 as u32, u32::MAX] {
        let wanted = format!("binary STL speaks of {count} triangles, there are 12");
        assert_eq!(counted(count), wanted);
    }
}

#[test]
fn numbers_that_are_nowhere_are_refused_by_their_vertex() {
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e9] {
        let mut bytes = box_of_a_centimetre().binary_stl();
        // The second vertex of the fourth triangle, along z.
        let at = 84 + 3 * 50 + 12 + 12 + 8;
        bytes[at..at + 4].copy_from_slice(&wrong.to_le_bytes());
        let error = read_stl(&bytes).unwrap_err();
        assert!(
            matches!(error, MeshError::OutOfRange { vertex: 10, .. }),
            "{error}"
        );
    }
    let text = box_of_a_centimetre().text_stl();
    for wrong in ["nan", "inf", "-infinity", "1e999", "1e30"] {
        let error = refused(
            text.replacen("vertex 0e0", &format!("vertex {wrong}"), 1)
                .as_bytes(),
        );
        assert!(error.starts_with("vertex 0 is at ["), "{error}");
    }
    for wrong in ["", "abc", "0x10", "1,5", "--1", "\u{7f}"] {
        let error = refused(
            text.replacen("vertex 0e0", &format!("vertex {wrong}"), 1)
                .as_bytes(),
        );
        assert!(error.contains("wanted"), "{error}");
    }
}

#[test]
fn a_text_that_is_cut_short_or_goes_on_is_refused() {
    let text = box_of_a_centimetre().text_stl();
    let end = text.rfind("endsolid").unwrap() + "endsolid".len();
    for length in 6..end {
        let error = refused(&text.as_bytes()[..length]);
        assert!(error.starts_with("text STL, byte "), "{length}: {error}");
    }
    let error = refused(&text.as_bytes()[..end - 9]);
    assert!(
        error.ends_with("the text ends, wanted facet or endsolid"),
        "{error}"
    );
    let error = refused(format!("{text}and junk").as_bytes());
    assert!(
        error.ends_with("got \"and\", wanted solid or the end"),
        "{error}"
    );
    let four = text.replacen("endloop", "vertex 1 2 3\nendloop", 1);
    assert!(refused(four.as_bytes()).ends_with("got \"vertex\", wanted endloop"));
    let two = text.replacen("vertex 0e0 0 0\n", "", 1);
    assert!(refused(two.as_bytes()).ends_with("wanted vertex"));
}

#[test]
fn what_is_no_stl_is_refused() {
    for bytes in [
        &b""[..],
        b"solid",
        b"solid\n",
        b"soli",
        b"PK\x03\x04",
        &[0xff; 200],
    ] {
        assert!(read_stl(bytes).is_err());
    }
    assert_eq!(read_stl(b"solid x\nendsolid x\n"), Err(MeshError::Empty));
}

/// Without these triangles, so many edges are open.
#[test]
fn open_edges_are_counted() {
    let whole = ball(0.010, 2);
    let open = |parts: &Parts| match read_stl(&parts.binary_stl()) {
        Ok(_) => 0,
        Err(MeshError::Open { open_edges }) => open_edges,
        Err(other) => panic!("{other}"),
    };
    let without = |parts: &Parts, removed: &[usize]| {
        let mut rest = parts.clone();
        let mut number = 0;
        rest.triangles.retain(|_| {
            number += 1;
            !removed.contains(&(number - 1))
        });
        open(&rest)
    };
    let turned = |parts: &Parts, turned: &[usize]| {
        let mut other = parts.clone();
        for at in turned {
            other.triangles[*at].swap(0, 1);
        }
        open(&other)
    };
    let cube = box_of_a_centimetre();
    assert_eq!(open(&cube), 0);
    for side in 0..6 {
        assert_eq!(without(&cube, &[2 * side, 2 * side + 1]), 4, "side {side}");
        assert_eq!(without(&cube, &[2 * side]), 3, "half of side {side}");
        assert_eq!(turned(&cube, &[2 * side]), 3, "half of side {side} turned");
        assert_eq!(
            turned(&cube, &[2 * side, 2 * side + 1]),
            4,
            "side {side} turned"
        );
    }
    assert_eq!(open(&whole), 0);
    assert_eq!(without(&whole, &[0]), 3);
    assert_eq!(without(&whole, &[0, 127]), 6, "in separate places");
    assert_eq!(without(&whole, &[0, 63, 127]), 9);
    assert_eq!(turned(&whole, &[0, 127]), 6);
    let mut doubled = whole.clone();
    doubled.triangles.push(whole.triangles[5]);
    assert_eq!(open(&doubled), 3, "a triangle twice");
    // Where a vertex is a little off in one triangle, its two edges there have come apart, twice.
    let mut bytes = whole.binary_stl();
    bytes[84 + 12] ^= 1;
    assert_eq!(
        read_stl(&bytes),
        Err(MeshError::Open { open_edges: 4 }),
        "welding is exact"
    );
}

/// Triangles without area hold a side together that is cut differently on its two sides.
#[test]
fn triangles_without_area_close_what_they_are_there_for() {
    let mut parts = box_of_a_centimetre();
    // A vertex in the middle of the first side's diagonal, known to one of its halves only.
    let [a, b, c] = parts.triangles[0];
    let middle = parts.vertices_m.len() as u32;
    parts.vertices_m.push([0.0, 0.005, 0.005]);
    parts.triangles[0] = [a, b, middle];
    parts.triangles.push([b, c, middle]);
    assert_eq!(parts.mesh(), Err(MeshError::Open { open_edges: 3 }));
    parts.triangles.push([a, middle, c]);
    let mesh: TriangleMesh = parts.mesh().unwrap();
    assert!((mesh.volume_m3() - 1e-6).abs() < 1e-18);
}
