//! The archive around a model, read: which part is the model, and that part as text.
//!
//! An archive says how large its parts are. What it says is held against the bound first, then against what deflate
//! can do at all with the bytes that are there, and only then is memory taken, exactly as much; a part that turns out
//! longer or shorter is refused.

use std::iter;

use miniz_oxide::inflate::{TINFLStatus, decompress_slice_iter_to_slice};
use quick_xml::events::Event;
use quick_xml::reader::NsReader;
use rawzip::{CompressionMethod, ZipArchive, ZipFileHeaderRecord, ZipSliceArchive};

use crate::error::{Format, MeshError, beginning};
use crate::threemf::{MOST_PARTS, MOST_UNPACKED_BYTES};

const RELATIONSHIPS: &str = "_rels/.rels";
/// The relationship from a package to its model.
const TO_MODEL: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
/// A byte of deflate stands for 1032 at most.
const MOST_PER_DEFLATED_BYTE: u64 = 1032;

/// The text of a package's model.
pub(super) fn model_text(bytes: &[u8]) -> Result<String, MeshError> {
    let archive = ZipArchive::from_slice(bytes).map_err(|error| broken(&error))?;
    let mut unpacked = 0;
    let relationships = part(&archive, RELATIONSHIPS, &mut unpacked)?;
    let name = model_name(&relationships)?;
    part(&archive, &name, &mut unpacked)
}

/// The name of the part that relationships say is the model.
fn model_name(relationships: &str) -> Result<String, MeshError> {
    let mut reader = NsReader::from_str(relationships);
    reader.config_mut().expand_empty_elements = true;
    loop {
        let at = reader.buffer_position() as usize;
        let event = reader.read_event();
        let broken = |problem: String| MeshError::malformed(Format::Model, at, problem);
        match event.map_err(|error| broken(beginning(error)))? {
            Event::Start(start) if start.local_name().as_ref() == "Relationship" => {
                let (mut kind, mut target) = (None, None);
                for attribute in start.attributes().with_checks(false) {
                    let attribute = attribute.map_err(|error| broken(beginning(error)))?;
                    match attribute.key.into_inner() {
                        "Type" => kind = Some(attribute.value),
                        "Target" => target = Some(attribute.value),
                        _ => {}
                    }
                }
                if kind.as_deref() == Some(TO_MODEL) {
                    let target = target.ok_or_else(|| broken("a model without a place".into()))?;
                    return Ok(target.trim_start_matches('/').to_owned());
                }
            }
            Event::DocType(_) => return Err(broken("a document type, which 3MF forbids".into())),
            Event::Eof => {
                let problem = "no part of the package is said to be its model";
                return Err(broken(problem.into()));
            }
            _ => {}
        }
    }
}

/// The text of a part. Names are told apart without regard to case.
fn part(
    archive: &ZipSliceArchive<&[u8]>,
    name: &str,
    unpacked: &mut usize,
) -> Result<String, MeshError> {
    let mut entries = archive.entries();
    let mut found = None;
    let mut parts = 0;
    while let Some(entry) = entries.next_entry().map_err(|error| broken(&error))? {
        parts += 1;
        if MOST_PARTS < parts {
            return Err(too_much("parts", parts as u64, MOST_PARTS));
        }
        let path = entry.file_path();
        if path.as_bytes().eq_ignore_ascii_case(name.as_bytes()) && found.replace(entry).is_some() {
            // Two readers could take one each.
            return Err(problem(format!("two parts are called {}", beginning(name))));
        }
    }
    if parts as u64 != archive.entries_hint() {
        return Err(MeshError::SelfContradicting {
            format: Format::Package,
            what: "parts",
            said: archive.entries_hint(),
            found: parts as u64,
        });
    }
    let entry = found.ok_or_else(|| problem(format!("there is no part {}", beginning(name))))?;
    let content = unpack(archive, &entry, unpacked)?;
    String::from_utf8(content).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        MeshError::malformed(Format::Model, at, "not UTF-8")
    })
}

fn unpack(
    archive: &ZipSliceArchive<&[u8]>,
    entry: &ZipFileHeaderRecord<'_>,
    unpacked: &mut usize,
) -> Result<Vec<u8>, MeshError> {
    if entry.flags().is_encrypted() {
        return Err(problem("a part is encrypted"));
    }
    let packed = archive.get_entry(entry.wayfinder());
    let packed = packed.map_err(|error| broken(&error))?.data();
    let said = entry.uncompressed_size_hint();
    let room = MOST_UNPACKED_BYTES - *unpacked;
    if (room as u64) < said {
        let got = said.saturating_add(*unpacked as u64);
        return Err(too_much("unpacked bytes", got, MOST_UNPACKED_BYTES));
    }
    let differs = |found: usize| MeshError::SelfContradicting {
        format: Format::Package,
        what: "bytes in a part",
        said,
        found: found as u64,
    };
    let content = match entry.compression_method() {
        CompressionMethod::STORE if packed.len() as u64 == said => packed.to_vec(),
        CompressionMethod::STORE => return Err(differs(packed.len())),
        CompressionMethod::DEFLATE => {
            let most = packed.len() as u64 * MOST_PER_DEFLATED_BYTE;
            if most < said {
                return Err(differs(most as usize));
            }
            let mut content = vec![0; said as usize];
            match decompress_slice_iter_to_slice(&mut content, iter::once(packed), false, true) {
                Ok(bytes) if bytes == content.len() => content,
                Ok(bytes) => return Err(differs(bytes)),
                Err(TINFLStatus::HasMoreOutput) => return Err(differs(content.len() + 1)),
                Err(_) => return Err(problem("a part cannot be unpacked")),
            }
        }
        other => {
            let number = other.as_u16();
            return Err(problem(format!(
                "a part is packed by method {number}, wanted 0 or 8"
            )));
        }
    };
    if rawzip::crc32(&content) != entry.crc32() {
        return Err(problem("a part is not what its checksum says"));
    }
    *unpacked += content.len();
    Ok(content)
}

fn too_much(what: &'static str, got: u64, most: usize) -> MeshError {
    MeshError::TooMuch {
        format: Format::Package,
        what,
        got,
        most: most as u64,
    }
}

/// What the archive's reader found wrong.
fn broken(error: &rawzip::Error) -> MeshError {
    problem(beginning(error))
}

fn problem(problem: impl Into<std::borrow::Cow<'static, str>>) -> MeshError {
    MeshError::malformed(Format::Package, 0, problem)
}
