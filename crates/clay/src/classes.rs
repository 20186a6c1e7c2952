//! Classes of material in a block: which voxel is of which.
//!
//! A block has one class, or up to [`MAX_CLASSES`]. The first resists with the material that the law is called with;
//! the others have theirs here. A voxel's class is fixed when the block is made: cutting takes clay away and leaves the
//! class of the place. So classes are shared by every copy of the clay, and a block of one class has none of this.
//!
//! A brick of one class throughout takes four bytes, and so does one that has its classes where another has them; any
//! other takes a byte for each of its voxels besides. Layers therefore take next to nothing.
//!
//! As bytes, which are the same for the same classes ([`Classes::encoded`]):
//!
//! ```text
//! version  bricks x, y, z  further  | viscosity  yield  stiffness | patterns | runs of a brick | | count   code   |
//! u8       u16 each        u8       | f64        f64    f64       | number   | u8 each         | | number  number |
//!                                     for each further class                   for each pattern    until all are told
//! ```
//!
//! A number is of seven bits a byte, the lowest first, the highest bit set on all but the last. A run is so many equal
//! voxels of a brick, in their order: the class in the lowest three bits, above it how many, 1 to 31. A code below 8 is
//! a class that bricks have throughout; one above is a pattern's number, from 8 on.

use std::collections::HashMap;

use thiserror::Error;

use crate::grid::{BRICK_EDGE, BRICK_VOXELS, BrickIndex, Grid};
use crate::hash;
use crate::law::{Coefficients, Material, MaterialError};

/// Most classes of a block, the first included.
pub const MAX_CLASSES: usize = 8;

const VERSION: u8 = 1;
/// Binary places of a class in a run.
const CLASS_PLACES: u32 = MAX_CLASSES.trailing_zeros();
/// Longest run of equal voxels in one byte.
const LONGEST_RUN: usize = u8::MAX as usize >> CLASS_PLACES;
/// Codes of bricks that are of one class throughout come first.
const FIRST_PATTERN: u32 = MAX_CLASSES as u32;

/// Which voxel of a block is of which class. Invariant: as many bricks as the grid it was made for, no class but those
/// that there are, and the encoding that of the content.
#[derive(Clone, Debug)]
pub struct Classes {
    counts: [u16; 3],
    further: Vec<Material>,
    /// A class, or from [`FIRST_PATTERN`] on a pattern.
    bricks: Vec<u32>,
    patterns: Vec<[u8; BRICK_VOXELS]>,
    encoded: Vec<u8>,
    digest: u64,
}

/// A layer of a block, from its top downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// How thick it is, m.
    pub thickness_m: f64,
    /// What it resists with.
    pub material: Material,
}

/// Why there are no such classes.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ClassesError {
    /// More classes than a block may have, or none beside the first.
    #[error("{got} classes, wanted 2 to {MAX_CLASSES}")]
    Count {
        /// How many, the first included.
        got: usize,
    },
    /// A voxel of a class that there is not.
    #[error("brick {brick} has a voxel of class {got}, there are {classes}")]
    Unknown {
        /// The brick's dense number.
        brick: u32,
        /// The class as it came.
        got: u8,
        /// How many there are.
        classes: usize,
    },
    /// A layer that has no thickness.
    #[error("layer {index} is {got_m} m thick, wanted finite and above zero")]
    Thickness {
        /// Which layer, from 0.
        index: usize,
        /// Its thickness as it came, m.
        got_m: f64,
    },
    /// They are those of another block.
    #[error("classes of {got:?} bricks, the block has {want:?}")]
    OtherGrid {
        /// Bricks that they were made for, along x, y, z.
        got: [u16; 3],
        /// The block's.
        want: [u16; 3],
    },
    /// A further class has coefficients that no clay has.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// Bytes that are no classes.
    #[error("classes: {problem}")]
    Malformed {
        /// What is wrong with them.
        problem: &'static str,
    },
}

impl Classes {
    /// Classes of a block: `further` are the materials of all but the first; `fill` writes the class of each voxel of a
    /// brick, x fastest, then y, then z. What it writes beyond the grid does not matter.
    ///
    /// # Errors
    /// There are too few or too many classes, or a voxel is of one that there is not.
    pub fn new(
        grid: &Grid,
        further: Vec<Material>,
        mut fill: impl FnMut(BrickIndex, &mut [u8; BRICK_VOXELS]),
    ) -> Result<Self, ClassesError> {
        let classes = further.len() + 1;
        if !(2..=MAX_CLASSES).contains(&classes) {
            return Err(ClassesError::Count { got: classes });
        }
        let mut bricks = Vec::with_capacity(grid.brick_count());
        let mut patterns: Vec<[u8; BRICK_VOXELS]> = Vec::new();
        let mut known: HashMap<u64, Vec<u32>> = HashMap::new();
        let mut voxels = [0; BRICK_VOXELS];
        for dense in 0..grid.brick_count() {
            let index = BrickIndex::new(dense);
            voxels.fill(0);
            fill(index, &mut voxels);
            level_outside(grid.brick_extent(index), &mut voxels);
            if let Some(&got) = voxels.iter().find(|class| classes <= usize::from(**class)) {
                let brick = index.as_u32();
                return Err(ClassesError::Unknown {
                    brick,
                    got,
                    classes,
                });
            }
            if voxels.iter().all(|class| *class == voxels[0]) {
                bricks.push(voxels[0].into());
                continue;
            }
            let alike = known.entry(hash::of_bytes(&voxels)).or_default();
            let found = alike.iter().find(|&&at| patterns[at as usize] == voxels);
            let pattern = found.copied().unwrap_or_else(|| {
                let pattern = patterns.len() as u32;
                patterns.push(voxels);
                alike.push(pattern);
                pattern
            });
            bricks.push(FIRST_PATTERN + pattern);
        }
        let mut made = Self {
            counts: grid.bricks(),
            further,
            bricks,
            patterns,
            encoded: Vec::new(),
            digest: 0,
        };
        made.encoded = made.encode();
        made.digest = hash::of_bytes(&made.encoded);
        Ok(made)
    }

    /// Layers of a block, from `top_m` downwards; what is below them is of the first class. Each ends at the boundary
    /// between voxels that is nearest.
    ///
    /// # Errors
    /// There are none or too many, or one has no thickness.
    pub fn layers(grid: &Grid, top_m: f64, layers: &[Layer]) -> Result<Self, ClassesError> {
        let mut ends_at = Vec::with_capacity(layers.len());
        let mut height = top_m / grid.voxel_size_m();
        for (index, layer) in layers.iter().enumerate() {
            let got_m = layer.thickness_m;
            if !(got_m.is_finite() && 0.0 < got_m) {
                return Err(ClassesError::Thickness { index, got_m });
            }
            height -= got_m / grid.voxel_size_m();
            ends_at.push((height + 0.5).floor());
        }
        let further = layers.iter().map(|layer| layer.material).collect();
        Self::new(grid, further, |index, voxels| {
            let first = usize::from(grid.brick_coordinates(index)[2]) * BRICK_EDGE;
            let (layers, _) = voxels.as_chunks_mut::<{ BRICK_EDGE * BRICK_EDGE }>();
            for (at, voxels) in layers.iter_mut().enumerate() {
                let height = (first + at) as f64;
                let layer = ends_at.iter().position(|&end| end <= height);
                voxels.fill(layer.map_or(0, |layer| layer as u8 + 1));
            }
        })
    }

    /// Reads what [`Classes::encoded`] has written for a block of this grid. Memory for it is at most a byte for each
    /// voxel of the grid, and as much as `bytes` has.
    ///
    /// # Errors
    /// The bytes are none, or those of another grid. Whatever they are, nothing panics.
    pub fn decode(grid: &Grid, bytes: &[u8]) -> Result<Self, ClassesError> {
        let mut reader = Reader(bytes);
        if reader.byte()? != VERSION {
            return Err(malformed("another version"));
        }
        let counts = [reader.u16()?, reader.u16()?, reader.u16()?];
        if counts != grid.bricks() {
            return Err(ClassesError::OtherGrid {
                got: counts,
                want: grid.bricks(),
            });
        }
        let mut further = Vec::new();
        for _ in 0..reader.byte()? {
            further.push(Material::new(Coefficients {
                viscosity_pa_s_per_m: reader.f64()?,
                yield_stress_pa: reader.f64()?,
                stiffness_pa: reader.f64()?,
            })?);
        }
        let count = reader.number()? as usize;
        if grid.brick_count() < count {
            return Err(malformed("more patterns than bricks"));
        }
        let mut patterns = Vec::new();
        for _ in 0..count {
            patterns.push(reader.pattern()?);
        }
        let mut codes = Vec::with_capacity(grid.brick_count());
        while codes.len() < grid.brick_count() {
            let (run, code) = (reader.number()? as usize, reader.number()? as usize);
            if run == 0 || grid.brick_count() - codes.len() < run {
                return Err(malformed("runs of bricks that do not fill the grid"));
            }
            if MAX_CLASSES + patterns.len() <= code {
                return Err(malformed("a pattern that there is not"));
            }
            codes.extend(std::iter::repeat_n(code, run));
        }
        let read = Self::new(grid, further, |index, voxels| {
            match codes[index.dense()].checked_sub(MAX_CLASSES) {
                None => voxels.fill(codes[index.dense()] as u8),
                Some(pattern) => *voxels = patterns[pattern],
            }
        })?;
        if read.encoded != bytes {
            return Err(malformed("bytes that no writer makes"));
        }
        Ok(read)
    }

    /// The classes as bytes: the same for the same classes of the same grid.
    #[must_use]
    pub fn encoded(&self) -> &[u8] {
        &self.encoded
    }

    /// Materials of all classes but the first.
    #[must_use]
    pub fn further(&self) -> &[Material] {
        &self.further
    }

    /// The class of a voxel; the first one outside of the block.
    #[inline]
    #[must_use]
    pub fn at(&self, voxel: [i32; 3]) -> usize {
        let Some(brick) = self.brick_of(voxel) else {
            return 0;
        };
        let code = self.bricks[brick];
        let Some(pattern) = code.checked_sub(FIRST_PATTERN) else {
            return code as usize;
        };
        let [x, y, z] = voxel.map(|at| at as usize % BRICK_EDGE);
        self.patterns[pattern as usize][(z * BRICK_EDGE + y) * BRICK_EDGE + x].into()
    }

    /// Bytes of memory that they take, but for a few hundred.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.bricks.len() * size_of::<u32>()
            + self.patterns.len() * BRICK_VOXELS
            + self.encoded.len()
    }

    /// The class of a voxel and of its neighbours after it along x, y and z, if one brick has them all and they are
    /// known to be the same.
    #[inline]
    pub(crate) fn one_about(&self, lowest: [i32; 3]) -> Option<usize> {
        let is_inside = lowest
            .iter()
            .all(|at| at.rem_euclid(BRICK_EDGE as i32) < BRICK_EDGE as i32 - 1);
        let code = self.bricks[self.brick_of(lowest)?];
        (is_inside && code < FIRST_PATTERN).then_some(code as usize)
    }

    /// What they add to the hash of the clay.
    pub(crate) const fn digest(&self) -> u64 {
        self.digest
    }

    /// Whether they are classes of a grid's voxels.
    pub(crate) fn check_grid(&self, grid: &Grid) -> Result<(), ClassesError> {
        if self.counts == grid.bricks() {
            return Ok(());
        }
        Err(ClassesError::OtherGrid {
            got: self.counts,
            want: grid.bricks(),
        })
    }

    #[inline]
    fn brick_of(&self, voxel: [i32; 3]) -> Option<usize> {
        let counts = self.counts.map(i32::from);
        let [x, y, z] = voxel.map(|at| at.div_euclid(BRICK_EDGE as i32));
        let is_inside = (0..counts[0]).contains(&x)
            && (0..counts[1]).contains(&y)
            && (0..counts[2]).contains(&z);
        is_inside.then(|| ((z * counts[1] + y) * counts[0] + x) as usize)
    }

    fn encode(&self) -> Vec<u8> {
        let mut out = vec![VERSION];
        for count in self.counts {
            out.extend_from_slice(&count.to_le_bytes());
        }
        out.push(self.further.len() as u8);
        for material in &self.further {
            let Coefficients {
                viscosity_pa_s_per_m,
                yield_stress_pa,
                stiffness_pa,
            } = material.coefficients();
            for coefficient in [viscosity_pa_s_per_m, yield_stress_pa, stiffness_pa] {
                out.extend_from_slice(&coefficient.to_le_bytes());
            }
        }
        put_number(&mut out, self.patterns.len() as u64);
        for pattern in &self.patterns {
            for run in pattern.chunk_by(|one, other| one == other) {
                for part in run.chunks(LONGEST_RUN) {
                    out.push(run[0] | (part.len() as u8) << CLASS_PLACES);
                }
            }
        }
        for run in self.bricks.chunk_by(|one, other| one == other) {
            put_number(&mut out, run.len() as u64);
            put_number(&mut out, run[0].into());
        }
        out
    }
}

impl PartialEq for Classes {
    fn eq(&self, other: &Self) -> bool {
        self.encoded == other.encoded
    }
}

/// Gives what a brick has beyond its extent the class of its first voxel, so that it does not matter.
fn level_outside(extent: [usize; 3], voxels: &mut [u8; BRICK_VOXELS]) {
    if extent == [BRICK_EDGE; 3] {
        return;
    }
    let first = voxels[0];
    for (at, class) in voxels.iter_mut().enumerate() {
        let place = [
            at % BRICK_EDGE,
            at / BRICK_EDGE % BRICK_EDGE,
            at / BRICK_EDGE / BRICK_EDGE,
        ];
        if (0..3).any(|axis| extent[axis] <= place[axis]) {
            *class = first;
        }
    }
}

fn put_number(out: &mut Vec<u8>, mut number: u64) {
    while 0x7F < number {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

const fn malformed(problem: &'static str) -> ClassesError {
    ClassesError::Malformed { problem }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ClassesError> {
        let (bytes, rest) = self
            .0
            .split_first_chunk()
            .ok_or(malformed("they end too early"))?;
        self.0 = rest;
        Ok(*bytes)
    }

    fn byte(&mut self) -> Result<u8, ClassesError> {
        self.bytes().map(|[byte]| byte)
    }

    fn u16(&mut self) -> Result<u16, ClassesError> {
        self.bytes().map(u16::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, ClassesError> {
        self.bytes().map(f64::from_le_bytes)
    }

    fn number(&mut self) -> Result<u32, ClassesError> {
        let mut number = 0;
        for shift in (0..28).step_by(7) {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(malformed("a number that is too large"))
    }

    fn pattern(&mut self) -> Result<[u8; BRICK_VOXELS], ClassesError> {
        let mut voxels = [0; BRICK_VOXELS];
        let mut rest = &mut voxels[..];
        while !rest.is_empty() {
            let byte = self.byte()?;
            let length = usize::from(byte >> CLASS_PLACES);
            let (run, left) = std::mem::take(&mut rest)
                .split_at_mut_checked(length)
                .ok_or(malformed("a run beyond its brick"))?;
            if run.is_empty() {
                return Err(malformed("a run of nothing"));
            }
            run.fill(byte & (MAX_CLASSES - 1) as u8);
            rest = left;
        }
        Ok(voxels)
    }
}
