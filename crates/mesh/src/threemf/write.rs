//! A 3MF package, written.

use std::fmt::Write as _;
use std::io::Write as _;

use rawzip::{CompressionMethod, ZipArchiveWriter};
use teleclay_clay::Mesh;

const MILLIMETRES_PER_METRE: f32 = 1e3;
/// What deflate aims at by default: further levels take twice as long for a hundredth.
const DEFLATE_LEVEL: u8 = 6;

const CONTENT_TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
 <Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
 <Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"#;

const RELATIONSHIPS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
 <Relationship Id="rel0" Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"#;

/// The mesh as a 3MF package with one object, lengths in millimetres: the numbers are those of the same mesh as STL. Of
/// an empty mesh the model builds nothing.
#[must_use]
pub fn encode(mesh: &Mesh) -> Vec<u8> {
    let model = model(mesh);
    let mut archive = ZipArchiveWriter::new(Vec::new());
    for (name, text) in [
        ("[Content_Types].xml", CONTENT_TYPES),
        ("_rels/.rels", RELATIONSHIPS),
        ("3D/3dmodel.model", &model),
    ] {
        add(&mut archive, name, text.as_bytes()).expect("memory takes what is written to it");
    }
    archive
        .finish()
        .expect("memory takes what is written to it")
}

fn add(
    archive: &mut ZipArchiveWriter<Vec<u8>>,
    name: &str,
    content: &[u8],
) -> Result<(), rawzip::Error> {
    let (mut entry, _) = archive
        .new_file(name)
        .compression_method(CompressionMethod::DEFLATE)
        .start()?;
    let packed = miniz_oxide::deflate::compress_to_vec(content, DEFLATE_LEVEL);
    entry.write_all(&packed)?;
    let said = rawzip::DataDescriptorOutput::new(rawzip::crc32(content), content.len() as u64);
    entry.finish(said)?;
    Ok(())
}

fn model(mesh: &Mesh) -> String {
    let mut text = String::from(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
 <metadata name="Application">teleclay</metadata>
"#,
    );
    if mesh.triangles.is_empty() {
        text.push_str(" <resources/>\n <build/>\n</model>\n");
        return text;
    }
    text.push_str(" <resources>\n  <object id=\"1\" type=\"model\" name=\"clay\">\n   <mesh>\n");
    text.push_str("    <vertices>\n");
    for at_m in &mesh.positions_m {
        let [x, y, z] = at_m.map(|at_m| at_m * MILLIMETRES_PER_METRE);
        writeln!(text, r#"<vertex x="{x}" y="{y}" z="{z}"/>"#).expect("a string takes it");
    }
    text.push_str("    </vertices>\n    <triangles>\n");
    for [a, b, c] in &mesh.triangles {
        writeln!(text, r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#).expect("a string takes it");
    }
    text.push_str("    </triangles>\n   </mesh>\n  </object>\n </resources>\n");
    text.push_str(" <build>\n  <item objectid=\"1\"/>\n </build>\n</model>\n");
    text
}
