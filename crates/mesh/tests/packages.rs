//! 3MF packages as they come: units, transforms, objects made of others; and everything that can be wrong with one.

mod archive;
mod shapes;

use teleclay_mesh::threemf::{MOST_PARTS, MOST_UNPACKED_BYTES};
use teleclay_mesh::triangles::MOST_TRIANGLES;
use teleclay_mesh::{Format, MeshError, TriangleMesh, read_3mf};

use archive::{CONTENT_TYPES, MODEL, Part, RELATIONSHIPS, archive, package, parts};
use shapes::{Parts, cuboid, tetrahedron};

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";

/// A mesh as XML, in its own numbers.
fn mesh(parts: &Parts) -> String {
    let mut text = String::from("<mesh><vertices>");
    for [x, y, z] in &parts.vertices_m {
        text += &format!(r#"<vertex x="{x}" y="{y}" z="{z}"/>"#);
    }
    text += "</vertices><triangles>";
    for [a, b, c] in &parts.triangles {
        text += &format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#);
    }
    text + "</triangles></mesh>"
}

fn model(attributes: &str, resources: &str, build: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><model xmlns="{CORE}" {attributes}><metadata
        name="Title">a &amp; b</metadata><resources>{resources}</resources><build>{build}</build></model>"#
    )
}

/// A cube of edge 2 with its lower corner at the origin, as object 1.
fn cube() -> String {
    format!(
        r#"<object id="1">{}</object>"#,
        mesh(&cuboid([0.0; 3], [2.0; 3]))
    )
}

const ITEM: &str = r#"<item objectid="1"/>"#;

fn read(model: &str) -> Result<TriangleMesh, MeshError> {
    read_3mf(&package(model))
}

fn refused(model: &str) -> String {
    read(model).expect_err("it should be refused").to_string()
}

fn assert_bounds(mesh: &TriangleMesh, lower_m: [f64; 3], upper_m: [f64; 3]) {
    let (lower, upper) = mesh.bounds_m();
    for axis in 0..3 {
        let (low, high) = (lower[axis] - lower_m[axis], upper[axis] - upper_m[axis]);
        assert!(
            low.abs() < 1e-12 && high.abs() < 1e-12,
            "{lower:?} to {upper:?}"
        );
    }
}

#[test]
fn every_unit_is_known_and_a_millimetre_if_none_is_said() {
    for (unit, metres) in [
        ("", 1e-3),
        (r#"unit="micron""#, 1e-6),
        (r#"unit="millimeter""#, 1e-3),
        (r#"unit="centimeter""#, 1e-2),
        (r#"unit="inch""#, 0.0254),
        (r#"unit="foot""#, 0.3048),
        (r#"unit="meter""#, 1.0),
    ] {
        let mesh = read(&model(unit, &cube(), ITEM)).unwrap();
        assert_bounds(&mesh, [0.0; 3], [2.0 * metres; 3]);
    }
    for wrong in ["parsec", "Millimeter", "mm", ""] {
        let error = refused(&model(&format!(r#"unit="{wrong}""#), &cube(), ITEM));
        assert!(
            error.ends_with("wanted micron, millimeter, centimeter, inch, foot or meter"),
            "{error}"
        );
    }
}

/// A point is a row, and a transform's last three numbers are where the origin goes.
#[test]
fn transforms_turn_scale_and_shift() {
    let block = format!(
        r#"<object id="1">{}</object>"#,
        mesh(&cuboid([0.0; 3], [1.0, 2.0, 3.0]))
    );
    for (transform, lower_mm, upper_mm) in [
        (
            "1 0 0 0 1 0 0 0 1 10 20 30",
            [10.0, 20.0, 30.0],
            [11.0, 22.0, 33.0],
        ),
        ("2 0 0 0 3 0 0 0 4 1 1 1", [1.0; 3], [3.0, 7.0, 13.0]),
        // x to y, y to z, z to x.
        ("0 1 0 0 0 1 1 0 0 0 0 0", [0.0; 3], [3.0, 1.0, 2.0]),
        // A quarter turn about z: x to y, y to -x.
        ("0 1 0 -1 0 0 0 0 1 5 0 0", [3.0, 0.0, 0.0], [5.0, 1.0, 3.0]),
        // Sheared: y rises with x.
        ("1 1 0 0 1 0 0 0 1 0 0 0", [0.0; 3], [1.0, 3.0, 3.0]),
    ] {
        let item = format!(r#"<item objectid="1" transform="{transform}"/>"#);
        let mesh = read(&model("", &block, &item)).unwrap();
        assert_bounds(
            &mesh,
            lower_mm.map(|at| at * 1e-3),
            upper_mm.map(|at| at * 1e-3),
        );
    }
}

/// Of two items one is mirrored; were its triangles left as they are, it would count against the other.
#[test]
fn what_is_mirrored_is_not_inside_out() {
    let items = format!(r#"{ITEM}<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 10 0 0"/>"#);
    let mesh = read(&model("", &cube(), &items)).unwrap();
    assert!((mesh.volume_m3() - 16e-9).abs() < 1e-18);
    assert_bounds(&mesh, [0.0; 3], [0.010, 0.002, 0.002]);
}

/// First the component's own transform, then that of what it is part of, then the item's.
#[test]
fn objects_are_made_of_others() {
    let resources = format!(
        r#"{}<object id="7"><components>
            <component objectid="1"/>
            <component objectid="1" transform="2 0 0 0 2 0 0 0 2 10 0 0"/>
        </components></object>
        <object id="9"><components>
            <component objectid="7" transform="0 1 0 0 0 1 1 0 0 0 0 0"/>
        </components></object>"#,
        cube()
    );
    let item = r#"<item objectid="9" transform="1 0 0 0 1 0 0 0 1 100 0 0"/>"#;
    let mesh = read(&model("", &resources, item)).unwrap();
    assert!((mesh.volume_m3() - 72e-9).abs() < 1e-18);
    assert_bounds(&mesh, [0.100, 0.0, 0.0], [0.104, 0.014, 0.004]);
    assert_eq!(mesh.triangles().len(), 24);
    let two = format!(r#"{item}<item objectid="7"/>"#);
    let mesh = read(&model("", &resources, &two)).unwrap();
    assert!((mesh.volume_m3() - 144e-9).abs() < 1e-18);
}

#[test]
fn only_what_is_built_counts_and_no_supports() {
    let large = mesh(&cuboid([0.0; 3], [50.0; 3]));
    let resources = format!(
        r#"{}<object id="2">{large}</object><object id="3" type="support">{large}</object>
        <object id="4" type="model">{}</object>"#,
        cube(),
        mesh(&tetrahedron([3.0; 3]).shifted([5.0; 3]))
    );
    let items = r#"<item objectid="1"/><item objectid="3"/><item objectid="4"/>"#;
    let mesh = read(&model("", &resources, items)).unwrap();
    assert_bounds(&mesh, [0.0; 3], [0.008; 3]);
    assert!((mesh.volume_m3() - 12.5e-9).abs() < 1e-18);
    assert_eq!(read(&model("", &cube(), "")), Err(MeshError::Empty));
    assert_eq!(
        read(&model("", &resources, r#"<item objectid="3"/>"#)),
        Err(MeshError::Empty)
    );
}

#[test]
fn what_the_core_does_not_know_is_passed_over_unless_it_is_required() {
    let materials = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02";
    let other = "http://example.org/other";
    let foreign = format!(
        r#"<basematerials id="5"><base name="x" displaycolor="red"/></basematerials>
        <o:object id="1"><mesh/></o:object>{}"#,
        cube().replace(
            "<mesh>",
            "<o:mesh><vertices><vertex/></vertices></o:mesh><mesh>"
        )
    );
    let with = |required: &str| {
        let attributes =
            format!(r#"xmlns:m="{materials}" xmlns:o="{other}" requiredextensions="{required}""#);
        read(&model(&attributes, &foreign, ITEM))
    };
    assert_bounds(&with("").unwrap(), [0.0; 3], [0.002; 3]);
    assert_bounds(&with("m").unwrap(), [0.0; 3], [0.002; 3]);
    for required in ["o", "m o", "unheard"] {
        let error = with(required).unwrap_err().to_string();
        assert!(
            error.contains("the model requires the extension"),
            "{error}"
        );
    }
    // Under a prefix, the core is the core.
    let prefixed = model("", &cube(), ITEM)
        .replace("<", "<c:")
        .replace("<c:/", "</c:")
        .replace("<c:?", "<?")
        .replace("xmlns=", "xmlns:c=");
    assert_bounds(&read(&prefixed).unwrap(), [0.0; 3], [0.002; 3]);
    let elsewhere = model("", &cube(), ITEM).replace(CORE, other);
    assert!(refused(&elsewhere).ends_with("wanted a model of the core of 3MF"));
}

#[test]
fn a_model_that_contradicts_itself_is_refused() {
    let missing = cube().replace(r#"v1="0""#, r#"v1="8""#);
    assert_eq!(
        refused(&model("", &missing, ITEM)),
        "XML of a 3MF package speaks of 9 vertices, there are 8"
    );
    for (resources, items, wanted) in [
        (
            cube(),
            r#"<item objectid="2"/>"#,
            "object 2 is named and does not stand before",
        ),
        (cube() + &cube(), ITEM, "a second object 1"),
        (
            r#"<object id="1"><components><component objectid="1"/></components></object>"#.into(),
            ITEM,
            "object 1 is named and does not stand before",
        ),
        (
            r#"<object id="1"><components><component objectid="2"/></components></object>
            <object id="2"><components><component objectid="1"/></components></object>"#
                .into(),
            ITEM,
            "object 2 is named and does not stand before",
        ),
    ] {
        let error = refused(&model("", &resources, items));
        assert!(error.ends_with(wanted), "{error}");
    }
}

#[test]
fn numbers_that_are_none_are_refused_with_their_place() {
    for (from, to, wanted) in [
        (
            r#"x="0""#,
            r#"x="nan""#,
            "wanted a finite number for x, y and z",
        ),
        (
            r#"x="0""#,
            r#"x="-inf""#,
            "wanted a finite number for x, y and z",
        ),
        (
            r#"x="0""#,
            r#"x="1e999""#,
            "wanted a finite number for x, y and z",
        ),
        (
            r#"x="0""#,
            r#"x="""#,
            "wanted a finite number for x, y and z",
        ),
        (r#"x="0" "#, "", "wanted a finite number for x, y and z"),
        (r#"x="0""#, r#"x="0" x="0""#, "x is said twice"),
        (
            r#"v1="0""#,
            r#"v1="-1""#,
            "wanted a whole number from 0 to 4294967295",
        ),
        (
            r#"v1="0""#,
            r#"v1="4294967296""#,
            "wanted a whole number from 0 to 4294967295",
        ),
        (
            r#"v1="0""#,
            r#"v1="0.5""#,
            "wanted a whole number from 0 to 4294967295",
        ),
        (
            r#"id="1""#,
            r#"id="one""#,
            "wanted a whole number from 0 to 4294967295",
        ),
    ] {
        let text = model("", &cube(), ITEM).replacen(from, to, 1);
        assert_ne!(text, model("", &cube(), ITEM), "{from}");
        let error = refused(&text);
        let start = "XML of a 3MF package, byte ";
        assert!(
            error.starts_with(start) && error.ends_with(wanted),
            "{to}: {error}"
        );
    }
    let far = model("", &cube(), ITEM).replacen(r#"x="0""#, r#"x="1e300""#, 1);
    assert!(matches!(
        read(&far),
        Err(MeshError::OutOfRange { vertex: 0, .. })
    ));
    for (transform, wanted) in [
        ("1 0 0 0 1 0 0 0 1 0 0", "a transform is not twelve numbers"),
        (
            "1 0 0 0 1 0 0 0 1 0 0 0 0",
            "a transform is not twelve numbers",
        ),
        (
            "1 0 0 0 1 0 0 0 1 0 0 nan",
            "a transform is not twelve numbers",
        ),
        (
            "1 0 0 0 1 0 0 0 0 0 0 0",
            "a transform flattens what it moves",
        ),
        (
            "1e200 0 0 0 1e200 0 0 0 1e-200 0 0 0",
            "wanted finite numbers of at most 100000 m",
        ),
    ] {
        let item = format!(r#"<item objectid="1" transform="{transform}"/>"#);
        let error = refused(&model("", &cube(), &item));
        assert!(error.ends_with(wanted), "{error}");
    }
}

#[test]
fn xml_that_is_broken_is_refused() {
    let whole = model("", &cube(), ITEM);
    for length in 0..whole.len() {
        assert!(read(&whole[..length]).is_err(), "{}", &whole[..length]);
    }
    let nested = "<a>".repeat(100) + &"</a>".repeat(100);
    for (wrong, wanted) in [
        (whole.replace("</resources>", "</resource>"), "expected"),
        (
            whole.replacen("<resources>", &format!("<resources>{nested}"), 1),
            "nested too deep",
        ),
        (
            whole.replacen("<model", "<!DOCTYPE model [<!ENTITY a \"b\">]><model", 1),
            "forbids",
        ),
        (format!("{whole}{whole}"), ""),
        (
            whole.replace("model", "modell"),
            "wanted a model of the core of 3MF",
        ),
        (String::new(), "there is no model"),
    ] {
        let error = refused(&wrong);
        assert!(
            error.starts_with("XML") && error.contains(wanted),
            "{error}"
        );
    }
    let mut latin = parts(&whole);
    latin[2] = Part::stored(MODEL, &[whole.as_bytes(), b"<!-- \xe9 -->"].concat());
    let error = read_3mf(&archive(&latin)).unwrap_err();
    assert!(error.to_string().ends_with("not UTF-8"), "{error}");
}

#[test]
fn an_archive_that_is_broken_is_refused() {
    let whole = package(&model("", &cube(), ITEM));
    assert!(read_3mf(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(read_3mf(&whole[..length]).is_err(), "{length}");
    }
    let with = |change: &dyn Fn(&mut Vec<Part>)| {
        let mut parts = parts(&model("", &cube(), ITEM));
        change(&mut parts);
        read_3mf(&archive(&parts))
    };
    let broken: [fn(&mut Vec<Part>) -> &'static str; 7] = [
        |parts| {
            parts[2].said_checksum ^= 1;
            "a part is not what its checksum says"
        },
        |parts| {
            parts[2].method = 12;
            "a part is packed by method 12, wanted 0 or 8"
        },
        |parts| {
            parts[2].flags = 1;
            "a part is encrypted"
        },
        |parts| {
            parts[2].packed[9] ^= 0xff;
            "a part"
        },
        |parts| {
            parts.remove(2);
            "there is no part 3D/3dmodel.model"
        },
        |parts| {
            parts.remove(1);
            "there is no part _rels/.rels"
        },
        |parts| {
            parts.push(parts[2].clone());
            "two parts are called 3D/3dmodel.model"
        },
    ];
    for change in broken {
        let mut parts = parts(&model("", &cube(), ITEM));
        let wanted = change(&mut parts);
        let error = read_3mf(&archive(&parts)).unwrap_err().to_string();
        assert!(
            error.starts_with("3MF package") && error.contains(wanted),
            "{wanted}: {error}"
        );
    }
    let shouted = with(&|parts| parts[2].name.make_ascii_uppercase());
    assert!(
        shouted.is_ok(),
        "names are told apart without regard to case"
    );
    // The end of an archive counts its parts twice.
    for count in [2_u8, 4] {
        let mut other = whole.clone();
        let end = other.len() - 22;
        (other[end + 8], other[end + 10]) = (count, count);
        let error = read_3mf(&other).unwrap_err().to_string();
        let wanted = format!("3MF package speaks of {count} parts, there are 3");
        assert_eq!(error, wanted);
    }
    let nowhere = with(&|parts| {
        parts[1] = Part::stored(RELATIONSHIPS, b"<Relationships/>");
    });
    assert!(
        nowhere
            .unwrap_err()
            .to_string()
            .ends_with("is said to be its model")
    );
}

/// Memory is taken for what a part is, not for what it is said to be.
#[test]
fn a_size_that_is_a_lie_is_refused() {
    let said = |bytes: u32, pack: fn(&str, &[u8]) -> Part| {
        let mut parts = parts(&model("", &cube(), ITEM));
        parts[2] = pack(MODEL, model("", &cube(), ITEM).as_bytes());
        let real = parts[2].said_bytes;
        parts[2].said_bytes = if bytes == 0 { real } else { bytes };
        (read_3mf(&archive(&parts)), real)
    };
    for pack in [Part::stored, Part::deflated] {
        let (whole, real) = said(0, pack);
        assert!(whole.is_ok());
        for lie in [1, real - 1, real + 1, 2 * real, 100 * real, 150_000_000] {
            let (error, _) = said(lie, pack);
            match error {
                Err(MeshError::SelfContradicting { said, found, .. }) => {
                    assert_eq!(said, u64::from(lie));
                    assert_ne!(found, said);
                }
                other => panic!("{lie}: {other:?}"),
            }
        }
        for lie in [MOST_UNPACKED_BYTES as u32 + 1, u32::MAX - 1] {
            let (error, _) = said(lie, pack);
            assert!(
                matches!(
                    error,
                    Err(MeshError::TooMuch {
                        what: "unpacked bytes",
                        ..
                    })
                ),
                "{error:?}"
            );
        }
    }
}

#[test]
fn a_bomb_does_not_go_off() {
    // Blanks, packed to a thousandth, that are truly there.
    let blanks = vec![b' '; MOST_UNPACKED_BYTES + 1];
    let mut bomb = parts("");
    bomb[2] = Part {
        packed: miniz_oxide::deflate::compress_to_vec(&blanks, 6),
        method: 8,
        ..Part::stored(MODEL, b"")
    };
    drop(blanks);
    bomb[2].said_bytes = MOST_UNPACKED_BYTES as u32 + 1;
    let bytes = archive(&bomb);
    assert!(bytes.len() < 1 << 20);
    assert!(matches!(
        read_3mf(&bytes),
        Err(MeshError::TooMuch {
            format: Format::Package,
            what: "unpacked bytes",
            ..
        })
    ));
    // And if it is said to be small, no more than that is unpacked.
    bomb[2].said_bytes = 1000;
    assert!(matches!(
        read_3mf(&archive(&bomb)),
        Err(MeshError::SelfContradicting { said: 1000, .. })
    ));
    let mut crowd = parts(&model("", &cube(), ITEM));
    while crowd.len() <= MOST_PARTS {
        crowd.push(Part::stored(
            &format!("{CONTENT_TYPES}{}", crowd.len()),
            b"",
        ));
    }
    assert!(matches!(
        read_3mf(&archive(&crowd)),
        Err(MeshError::TooMuch { what: "parts", .. })
    ));
    crowd.pop();
    assert!(read_3mf(&archive(&crowd)).is_ok());
}

/// Each object is the one before it, so many times.
fn doubling(first: &str, levels: u32, times: usize) -> String {
    let mut resources = first.to_owned();
    for level in 2..=levels {
        let component = format!(r#"<component objectid="{}"/>"#, level - 1);
        resources += &format!(
            r#"<object id="{level}"><components>{}</components></object>"#,
            component.repeat(times)
        );
    }
    model("", &resources, &format!(r#"<item objectid="{levels}"/>"#))
}

#[test]
fn a_short_model_of_many_objects_is_refused_before_they_are_placed() {
    // Touching at all sides, the same cube over and over is closed.
    assert!(read(&doubling(&cube(), 10, 2)).is_ok());
    for (levels, times, wanted) in [
        (15, 2, "meshes"),
        (16, 1000, "meshes"),
        (20, 1, "objects within each other"),
    ] {
        match read(&doubling(&cube(), levels, times)) {
            Err(MeshError::TooMuch { what, .. }) => assert_eq!(what, wanted),
            other => panic!("{wanted}: {other:?}"),
        }
    }
    let many = cube().replace(
        "</triangles>",
        &(r#"<triangle v1="0" v2="0" v3="0"/>"#.repeat(MOST_TRIANGLES / 4000) + "</triangles>"),
    );
    assert!(matches!(
        read(&doubling(&many, 3, 80)),
        Err(MeshError::TooMuch {
            format: Format::Model,
            what: "triangles",
            ..
        })
    ));
    let many = cube().replace(
        "</vertices>",
        &(r#"<vertex x="0" y="0" z="0"/>"#.repeat(MOST_TRIANGLES / 1000) + "</vertices>"),
    );
    assert!(matches!(
        read(&doubling(&many, 3, 80)),
        Err(MeshError::TooMuch {
            format: Format::Model,
            what: "vertices",
            ..
        })
    ));
    // Nothing, any number of times, is nothing, and takes no time.
    let nothing = r#"<object id="1"/>"#;
    assert_eq!(read(&doubling(nothing, 15, 20)), Err(MeshError::Empty));
}

#[test]
fn open_edges_of_a_package_are_counted_over_all_that_is_built() {
    let mut open = cuboid([0.0; 3], [2.0; 3]);
    open.triangles.drain(..2);
    let object = format!(r#"<object id="1">{}</object>"#, mesh(&open));
    let items = format!(r#"{ITEM}<item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>"#);
    assert_eq!(
        read(&model("", &object, &items)),
        Err(MeshError::Open { open_edges: 8 })
    );
}
