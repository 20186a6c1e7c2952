//! STL, read: triangles without any order, in numbers or in words.
//!
//! ```text
//!  0                  80        84
//! +------------------+---------+----------------------------------------------+
//! | header           | count   | count times:                                 |
//! | 80 bytes         | u32     |   normal 3 f32, vertices 3 x 3 f32, u16      |
//! +------------------+---------+----------------------------------------------+
//!
//! solid <name>                                            any letters, large or small; any white space
//!   facet normal <x> <y> <z>
//!     outer loop
//!       vertex <x> <y> <z>                                three times
//!     endloop
//!   endfacet                                              any number of these
//! endsolid <name>                                         any number of solids
//! ```
//!
//! STL has no unit; numbers are taken for millimetres, as slicers take them. Normals and the two bytes after each
//! triangle are not looked at: many programs write nonsense there, and the order of the vertices says the same.
//!
//! A file as long as its count says is binary, however its header begins: some programs begin binary files with
//! `solid`, too. No text is so long, since the count would be of letters.

use crate::error::{Format, MeshError};
use crate::triangles::{MOST_TRIANGLES, TriangleMesh};

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;
const METRES_PER_MILLIMETRE: f64 = 1e-3;

/// What reading takes at most, beside 64 KiB, for each byte of the file: a triangle of 50 bytes has three vertices of
/// 24, of which those that are kept are held twice while they are welded.
pub const MEMORY_PER_BYTE: usize = 6;

/// Reads an STL file, binary or text; lengths are millimetres.
///
/// # Errors
/// When the file is cut short or goes on after its end, is neither form of STL, has a number that is none, or its
/// triangles are no closed mesh.
pub fn read_stl(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let count = bytes
        .get(HEADER_BYTES - 4..HEADER_BYTES)
        .map(|count| u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let body = bytes.get(HEADER_BYTES..).unwrap_or_default();
    let is_as_long_as_it_says =
        count.is_some_and(|count| body.len() as u64 == u64::from(count) * TRIANGLE_BYTES as u64);
    let soup = if is_as_long_as_it_says {
        binary(body)?
    } else if is_text(bytes) {
        text(bytes)?
    } else {
        return Err(not_as_long(count, bytes.len()));
    };
    let triangles = (0..soup.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let triangles = triangles.collect();
    TriangleMesh::new(soup, triangles)
}

/// Vertices, m, three for each triangle.
fn binary(body: &[u8]) -> Result<Vec<[f64; 3]>, MeshError> {
    let triangles = body.len() / TRIANGLE_BYTES;
    check_count(Format::BinaryStl, triangles)?;
    let mut soup = Vec::with_capacity(3 * triangles);
    for triangle in body.as_chunks::<TRIANGLE_BYTES>().0 {
        let (numbers, _) = triangle[12..48].as_chunks::<4>();
        for at in numbers.as_chunks::<3>().0 {
            soup.push(at.map(|bytes| f64::from(f32::from_le_bytes(bytes)) * METRES_PER_MILLIMETRE));
        }
    }
    Ok(soup)
}

/// The error of a file that is no text, and as binary is shorter or longer than it says.
fn not_as_long(count: Option<u32>, bytes: usize) -> MeshError {
    let format = Format::BinaryStl;
    let Some(count) = count else {
        return MeshError::SelfContradicting {
            format,
            what: "bytes of a header",
            said: HEADER_BYTES as u64,
            found: bytes as u64,
        };
    };
    let body = bytes - HEADER_BYTES;
    let found = (body / TRIANGLE_BYTES) as u64;
    let said = u64::from(count);
    if said != found {
        return MeshError::SelfContradicting {
            format,
            what: "triangles",
            said,
            found,
        };
    }
    let more = body % TRIANGLE_BYTES;
    let problem = format!("{more} more bytes after the last of {count} triangles");
    MeshError::malformed(format, bytes - more, problem)
}

fn check_count(format: Format, triangles: usize) -> Result<(), MeshError> {
    if MOST_TRIANGLES < triangles {
        return Err(MeshError::TooMuch {
            format,
            what: "triangles",
            got: triangles as u64,
            most: MOST_TRIANGLES as u64,
        });
    }
    Ok(())
}

/// Text begins with its first word, and has no zero in it.
fn is_text(bytes: &[u8]) -> bool {
    let first = bytes.trim_ascii_start().first_chunk::<5>();
    first.is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !bytes.contains(&0)
}

/// Vertices, m, three for each triangle.
fn text(bytes: &[u8]) -> Result<Vec<[f64; 3]>, MeshError> {
    let mut words = Words { bytes, at: 0 };
    let mut soup = Vec::new();
    while words.expect_or_end("solid")? {
        words.skip_line();
        while words.either("facet", "endsolid")? {
            words.expect("normal")?;
            for _ in 0..3 {
                words.next();
            }
            words.expect("outer")?;
            words.expect("loop")?;
            for _ in 0..3 {
                words.expect("vertex")?;
                let at_mm = [words.number()?, words.number()?, words.number()?];
                soup.push(at_mm.map(|at| at * METRES_PER_MILLIMETRE));
            }
            words.expect("endloop")?;
            words.expect("endfacet")?;
            check_count(Format::TextStl, soup.len() / 3)?;
        }
        words.skip_line();
    }
    Ok(soup)
}

/// Words of a text, between white space.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    /// The next word; empty at the end.
    fn next(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let blank = rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
        let word = rest[blank..].iter();
        let length = word.take_while(|b| !b.is_ascii_whitespace()).count();
        self.at += blank + length;
        &rest[blank..blank + length]
    }

    /// Past the end of the line, which may hold a name of several words.
    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        let is_end = |b: &u8| matches!(b, b'\n' | b'\r');
        self.at += rest.iter().position(is_end).unwrap_or(rest.len());
    }

    fn expect(&mut self, wanted: &str) -> Result<(), MeshError> {
        let word = self.next();
        if word.eq_ignore_ascii_case(wanted.as_bytes()) {
            return Ok(());
        }
        Err(self.wanted(wanted, word))
    }

    /// Whether this word comes, and not the end.
    fn expect_or_end(&mut self, wanted: &str) -> Result<bool, MeshError> {
        let word = self.next();
        if word.is_empty() || word.eq_ignore_ascii_case(wanted.as_bytes()) {
            return Ok(!word.is_empty());
        }
        Err(self.wanted("solid or the end", word))
    }

    /// Whether the first of two words comes, and not the second.
    fn either(&mut self, first: &str, second: &str) -> Result<bool, MeshError> {
        let word = self.next();
        let is_first = word.eq_ignore_ascii_case(first.as_bytes());
        if is_first || word.eq_ignore_ascii_case(second.as_bytes()) {
            return Ok(is_first);
        }
        Err(self.wanted(&format!("{first} or {second}"), word))
    }

    fn number(&mut self) -> Result<f64, MeshError> {
        let word = self.next();
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        number.ok_or_else(|| self.wanted("a number", word))
    }

    /// The error of a word that is not the wanted one.
    fn wanted(&self, wanted: &str, word: &[u8]) -> MeshError {
        /// So much of a word is shown.
        const SHOWN_BYTES: usize = 24;
        let problem = if word.is_empty() {
            format!("the text ends, wanted {wanted}")
        } else {
            let shown = word[..word.len().min(SHOWN_BYTES)].escape_ascii();
            format!("got \"{shown}\", wanted {wanted}")
        };
        MeshError::malformed(Format::TextStl, self.at - word.len(), problem)
    }
}
