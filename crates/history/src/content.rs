//! Clay as bytes: brick by brick in dense order, rows of equal bricks and rows of equal voxels as one.
//!
//! ```text
//! version  voxels x, y, z  voxel_size_m  initial  hash  | 0 | count        air throughout
//! u8       number each     f64           number   u64   | 1 | count        solid throughout
//!                                                       | 2 | rows         (count, occupancy) up to 4096 voxels
//!                                                       | 3 | 4096 bytes
//! ```
//!
//! Clay of several classes of material is written as version 2. There the classes stand between the hash and the
//! bricks, as [their own module](teleclay_clay::classes) writes them, behind their length, a number. Clay of one class
//! is written as version 1, as it always was.

use std::sync::Arc;

use teleclay_clay::{BRICK_VOXELS, BrickIndex, BrickView, Classes, Clay, Grid};

use crate::bytes::{Malformed, Reader, put_number, put_text};

/// Of clay of one class.
const VERSION: u8 = 1;
/// Of clay of several.
const WITH_CLASSES: u8 = 2;
const AIR: u8 = 0;
const SOLID: u8 = 1;
const ROWS: u8 = 2;
const VOXELS: u8 = 3;

/// Writes clay behind what `out` holds.
pub fn encode(clay: &mut Clay, out: &mut Vec<u8>) {
    let grid = *clay.grid();
    let classes = clay.classes().cloned();
    out.push(classes.as_ref().map_or(VERSION, |_| WITH_CLASSES));
    for count in grid.voxels() {
        put_number(out, count.into());
    }
    out.extend_from_slice(&grid.voxel_size_m().to_le_bytes());
    put_number(out, clay.initial_units());
    out.extend_from_slice(&clay.hash().to_le_bytes());
    if let Some(classes) = &classes {
        put_text(out, classes.encoded());
    }
    let mut equal = (AIR, 0);
    for brick in bricks(&grid) {
        let view = clay.brick(brick);
        let code = match view {
            BrickView::Empty => AIR,
            BrickView::Full => SOLID,
            BrickView::Voxels(_) => VOXELS,
        };
        if code != equal.0 {
            put_equal(out, equal);
            equal = (code, 0);
        }
        equal.1 += 1;
        if let BrickView::Voxels(voxels) = view {
            equal.1 = 0;
            put_voxels(out, voxels);
        }
    }
    put_equal(out, equal);
}

fn bricks(grid: &Grid) -> impl Iterator<Item = BrickIndex> {
    let grid = *grid;
    (0..grid.brick_count() as u32).filter_map(move |dense| grid.brick_index(dense))
}

fn put_equal(out: &mut Vec<u8>, (code, count): (u8, u64)) {
    if 0 < count {
        out.push(code);
        put_number(out, count);
    }
}

fn put_voxels(out: &mut Vec<u8>, voxels: &[u8; BRICK_VOXELS]) {
    let start = out.len();
    out.push(ROWS);
    for row in voxels.chunk_by(|one, other| one == other) {
        put_number(out, row.len() as u64);
        out.push(row[0]);
        if BRICK_VOXELS < out.len() - start {
            out.truncate(start);
            out.push(VOXELS);
            out.extend_from_slice(voxels);
            return;
        }
    }
}

/// What a brick is read to.
enum Content {
    Air,
    Solid,
    Voxels(Box<[u8; BRICK_VOXELS]>),
}

/// Reads clay.
///
/// # Errors
/// The bytes are none, or the clay is not the one that was written. Whatever they are, nothing panics.
pub fn decode(bytes: &[u8]) -> Result<Clay, Malformed> {
    let mut reader = Reader::new(bytes);
    let version = reader.version(WITH_CLASSES)?;
    let mut voxels = [0_u16; 3];
    for count in &mut voxels {
        *count = reader.small("voxels")?;
    }
    let size = reader.slice(8, "the voxel size")?;
    let size_m = f64::from_le_bytes(std::array::from_fn(|at| size[at]));
    let grid = Grid::of_voxels(voxels, size_m).map_err(|error| text(&error))?;
    let initial_units = reader.number("the fresh block's units")?;
    let hash = reader.slice(8, "a hash")?;
    let hash = u64::from_le_bytes(std::array::from_fn(|at| hash[at]));
    let classes = if version < WITH_CLASSES {
        None
    } else {
        let classes = Classes::decode(&grid, reader.text("classes")?);
        Some(Arc::new(classes.map_err(|error| text(&error))?))
    };
    let mut contents = Vec::new();
    while contents.len() < grid.brick_count() {
        read_content(&mut reader, grid.brick_count(), &mut contents)?;
    }
    if !reader.is_empty() {
        let got = reader.left() as u64;
        let what = "the count of bytes behind the last brick";
        return Err(Malformed::Value { what, got });
    }
    let clay = Clay::from_bricks(grid, initial_units, |brick| {
        match &contents[brick.as_u32() as usize] {
            Content::Air => BrickView::Empty,
            Content::Solid => BrickView::Full,
            Content::Voxels(voxels) => BrickView::Voxels(voxels),
        }
    });
    let mut clay = clay.map_err(|error| text(&error))?;
    clay.assign_classes(classes).map_err(|error| text(&error))?;
    if clay.hash() != hash {
        return Err(Malformed::Value {
            what: "the clay's hash",
            got: clay.hash(),
        });
    }
    Ok(clay)
}

fn text(error: &dyn std::error::Error) -> Malformed {
    Malformed::Text {
        what: "clay",
        why: error.to_string(),
    }
}

fn read_content(
    reader: &mut Reader<'_>,
    bricks: usize,
    contents: &mut Vec<Content>,
) -> Result<(), Malformed> {
    const WHAT: &str = "a brick";
    match reader.byte(WHAT)? {
        code @ (AIR | SOLID) => {
            let count: usize = reader.small("a count of bricks")?;
            if count == 0 || bricks - contents.len() < count {
                let got = count as u64;
                return Err(Malformed::Value { what: WHAT, got });
            }
            let content = || {
                if code == AIR {
                    Content::Air
                } else {
                    Content::Solid
                }
            };
            contents.extend(std::iter::repeat_with(content).take(count));
        }
        ROWS => contents.push(Content::Voxels(read_rows(reader)?)),
        VOXELS => {
            let voxels = reader.slice(BRICK_VOXELS, WHAT)?;
            let mut content = Box::new([0; BRICK_VOXELS]);
            content.copy_from_slice(voxels);
            contents.push(Content::Voxels(content));
        }
        got => {
            let got = got.into();
            return Err(Malformed::Value { what: WHAT, got });
        }
    }
    Ok(())
}

fn read_rows(reader: &mut Reader<'_>) -> Result<Box<[u8; BRICK_VOXELS]>, Malformed> {
    let mut voxels = Box::new([0; BRICK_VOXELS]);
    let mut at = 0;
    while at < BRICK_VOXELS {
        let count: usize = reader.small("a row of voxels")?;
        if count == 0 || BRICK_VOXELS - at < count {
            let got = count as u64;
            let what = "the length of a row of voxels";
            return Err(Malformed::Value { what, got });
        }
        voxels[at..at + count].fill(reader.byte("a row of voxels")?);
        at += count;
    }
    Ok(voxels)
}
