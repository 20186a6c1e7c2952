//! Zip archives by another hand: written as a test wants them, lies included, and read by what their directory says.

#![allow(dead_code, reason = "every test uses some of it")]

use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec;

pub(crate) const CONTENT_TYPES: &str = "[Content_Types].xml";
pub(crate) const RELATIONSHIPS: &str = "_rels/.rels";
pub(crate) const MODEL: &str = "3D/3dmodel.model";

/// A part of an archive, and what the archive says of it.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) name: String,
    pub(crate) packed: Vec<u8>,
    pub(crate) method: u16,
    pub(crate) flags: u16,
    pub(crate) said_bytes: u32,
    pub(crate) said_checksum: u32,
}

impl Part {
    pub(crate) fn stored(name: &str, content: &[u8]) -> Self {
        Self {
            name: name.to_owned(),
            packed: content.to_vec(),
            method: 0,
            flags: 0,
            said_bytes: content.len() as u32,
            said_checksum: checksum(content),
        }
    }

    pub(crate) fn deflated(name: &str, content: &[u8]) -> Self {
        Self {
            packed: compress_to_vec(content, 6),
            method: 8,
            ..Self::stored(name, content)
        }
    }
}

/// CRC-32 as ISO 3309 has it, a bit at a time.
pub(crate) fn checksum(content: &[u8]) -> u32 {
    let mut rest = u32::MAX;
    for &byte in content {
        rest ^= u32::from(byte);
        for _ in 0..8 {
            rest = if rest & 1 == 1 {
                rest >> 1 ^ 0xedb8_8320
            } else {
                rest >> 1
            };
        }
    }
    !rest
}

/// The archive of these parts.
pub(crate) fn archive(parts: &[Part]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut directory = Vec::new();
    for part in parts {
        let begins = bytes.len() as u32;
        let mut header = Vec::new();
        for number in [20, part.flags, part.method, 0, 0x21] {
            header.extend_from_slice(&number.to_le_bytes());
        }
        for number in [
            part.said_checksum,
            part.packed.len() as u32,
            part.said_bytes,
        ] {
            header.extend_from_slice(&number.to_le_bytes());
        }
        header.extend_from_slice(&(part.name.len() as u16).to_le_bytes());
        header.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(b"PK\x03\x04");
        bytes.extend_from_slice(&header);
        bytes.extend_from_slice(part.name.as_bytes());
        bytes.extend_from_slice(&part.packed);
        directory.extend_from_slice(b"PK\x01\x02\x14\x00");
        directory.extend_from_slice(&header);
        directory.extend_from_slice(&[0; 10]);
        directory.extend_from_slice(&begins.to_le_bytes());
        directory.extend_from_slice(part.name.as_bytes());
    }
    let begins = bytes.len() as u32;
    bytes.extend_from_slice(&directory);
    bytes.extend_from_slice(b"PK\x05\x06\0\0\0\0");
    let count = parts.len() as u16;
    bytes.extend_from_slice(&count.to_le_bytes());
    bytes.extend_from_slice(&count.to_le_bytes());
    bytes.extend_from_slice(&(directory.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&begins.to_le_bytes());
    bytes.extend_from_slice(&[0, 0]);
    bytes
}

/// Names and contents of an archive's parts. Panics when anything is amiss.
pub(crate) fn unpacked(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let short = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let long = |at: usize| short(at) | short(at + 2) << 16;
    let end = bytes.len() - 22;
    assert_eq!(&bytes[end..end + 4], b"PK\x05\x06");
    let mut at = long(end + 16);
    let mut parts = Vec::new();
    for _ in 0..short(end + 10) {
        assert_eq!(&bytes[at..at + 4], b"PK\x01\x02");
        let (method, said_checksum) = (short(at + 10), long(at + 16));
        let (packed_bytes, said_bytes) = (long(at + 20), long(at + 24));
        let name_bytes = short(at + 28);
        let local = long(at + 42);
        let name = &bytes[at + 46..at + 46 + name_bytes];
        assert_eq!(&bytes[local..local + 4], b"PK\x03\x04");
        assert_eq!(&bytes[local + 30..local + 30 + short(local + 26)], name);
        assert_eq!(short(local + 8), method);
        let begins = local + 30 + short(local + 26) + short(local + 28);
        let packed = &bytes[begins..begins + packed_bytes];
        let content = if method == 0 {
            packed.to_vec()
        } else {
            assert_eq!(method, 8);
            decompress_to_vec(packed).unwrap()
        };
        assert_eq!(content.len(), said_bytes);
        assert_eq!(checksum(&content) as usize, said_checksum);
        parts.push((String::from_utf8(name.to_vec()).unwrap(), content));
        at += 46 + name_bytes + short(at + 30) + short(at + 32);
    }
    assert_eq!(at, end);
    parts
}

/// A package of a model's text.
pub(crate) fn package(model: &str) -> Vec<u8> {
    archive(&parts(model))
}

pub(crate) fn parts(model: &str) -> Vec<Part> {
    let relationships = format!(
        r#"<?xml version="1.0"?>
        <Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
        <Relationship Id="a" Type="http://schemas.openxmlformats.org/package/2006/relationships/metadata/thumbnail" Target="/Metadata/thumbnail.png"/>
        <Relationship Target="/{MODEL}" Id="b" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
        </Relationships>"#
    );
    vec![
        Part::stored(CONTENT_TYPES, b"<Types/>"),
        Part::deflated(RELATIONSHIPS, relationships.as_bytes()),
        Part::deflated(MODEL, model.as_bytes()),
    ]
}
