//! Samples as they came: bytes of one type on a grid, unpacked and checked.

use std::iter;

use miniz_oxide::inflate::decompress_slice_iter_to_slice;

use super::{MOST_SAMPLE_BYTES, VolumeError, VolumeFormat};

/// A byte of deflate stands for 1032 at most.
const MOST_PER_DEFLATED_BYTE: u64 = 1032;
/// Longest edge of a sample, m, and shortest.
const SPACING_M: std::ops::RangeInclusive<f64> = 1e-7..=1.0;

/// What a direction may stray from its axis, as a share: what writers round, and no angle.
const ROUNDING: f64 = 1e-6;

/// What a sample is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum SampleType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// In which order a sample has its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

/// How samples lie in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Packing {
    Raw,
    /// RFC 1952.
    Gzip,
    /// RFC 1950.
    Zlib,
}

/// A header, as far as it matters, before it is checked against anything.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Header {
    pub(crate) format: VolumeFormat,
    /// Along the file's axes, the fastest first.
    pub(crate) sizes: [u64; 3],
    /// From a sample to the next along each of the file's axes, m, as a vector along x, y, z.
    pub(crate) steps_m: [[f64; 3]; 3],
    pub(crate) sample: SampleType,
    pub(crate) endian: Endian,
    pub(crate) packing: Packing,
}

/// A volume. Invariant: as many samples as its sizes say, no size 0, spacings finite and above zero.
#[derive(Clone, Debug)]
pub struct Volume {
    sample: SampleType,
    endian: Endian,
    bytes: Vec<u8>,
    /// Along x, y, z.
    sizes: [usize; 3],
    spacing_m: [f64; 3],
    /// Number of the sample at the lower corner, and how far it is to the next along x, y, z.
    first: usize,
    strides: [isize; 3],
}

impl SampleType {
    /// Bytes of a sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl Volume {
    pub(crate) fn read(header: &Header, data: &[u8]) -> Result<Self, VolumeError> {
        let format = header.format;
        let mut said = header.sample.bytes() as u64;
        for (axis, size) in header.sizes.into_iter().enumerate() {
            if size == 0 {
                let problem = format!("axis {axis} has no samples");
                return Err(VolumeError::malformed(format, problem));
            }
            // However large the factors are, this does not wrap.
            said = said.saturating_mul(size);
        }
        if MOST_SAMPLE_BYTES < said {
            return Err(VolumeError::TooMuch { format, got: said });
        }
        let mut volume = Self {
            sample: header.sample,
            endian: header.endian,
            bytes: Vec::new(),
            sizes: [0; 3],
            spacing_m: [0.0; 3],
            first: 0,
            strides: [0; 3],
        };
        volume.orient(header)?;
        volume.bytes = unpack(header, data, said as usize)?;
        Ok(volume)
    }

    /// Finds out which axis of the file runs along which of x, y, z, and which way.
    fn orient(&mut self, header: &Header) -> Result<(), VolumeError> {
        let format = header.format;
        let mut stride = 1_isize;
        for (axis, (size, step_m)) in header.sizes.into_iter().zip(header.steps_m).enumerate() {
            let longest_m = step_m
                .iter()
                .fold(0.0, |most: f64, step| most.max(step.abs()));
            let is_along = |along: &usize| ROUNDING * longest_m < step_m[*along].abs();
            let is_finite = step_m.iter().all(|step| step.is_finite());
            let mut along = (0..3).filter(is_along);
            let (Some(only), None, true) = (along.next(), along.next(), is_finite) else {
                let problem = format!(
                    "axis {axis} runs along {step_m:?} m, wanted along one of x, y, z: oblique volumes are not read"
                );
                return Err(VolumeError::malformed(format, problem));
            };
            if self.sizes[only] != 0 {
                let problem = format!("two axes run along {}", ["x", "y", "z"][only]);
                return Err(VolumeError::malformed(format, problem));
            }
            let spacing_m = step_m[only].abs();
            if !SPACING_M.contains(&spacing_m) {
                let problem = format!(
                    "samples are {spacing_m} m apart along axis {axis}, wanted {} to {} m",
                    SPACING_M.start(),
                    SPACING_M.end()
                );
                return Err(VolumeError::malformed(format, problem));
            }
            self.sizes[only] = size as usize;
            self.spacing_m[only] = spacing_m;
            if step_m[only] < 0.0 {
                self.first += (size as usize - 1) * stride as usize;
                self.strides[only] = -stride;
            } else {
                self.strides[only] = stride;
            }
            stride *= size as isize;
        }
        Ok(())
    }

    /// Samples along x, y, z.
    #[must_use]
    pub const fn sizes(&self) -> [usize; 3] {
        self.sizes
    }

    /// From sample to sample along x, y, z, m.
    #[must_use]
    pub const fn spacing_m(&self) -> [f64; 3] {
        self.spacing_m
    }

    /// Edges along x, y, z, m: a sample stands for a box around it.
    #[must_use]
    pub fn size_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.sizes[axis] as f64 * self.spacing_m[axis])
    }

    /// A sample, as a number.
    ///
    /// # Panics
    /// When there is none at the place.
    #[must_use]
    pub fn sample(&self, [x, y, z]: [usize; 3]) -> f64 {
        let [dx, dy, dz] = self.strides;
        let number = self.first as isize + x as isize * dx + y as isize * dy + z as isize * dz;
        let length = self.sample.bytes();
        let bytes = &self.bytes[number as usize * length..][..length];
        let mut eight = [0; 8];
        for (at, byte) in bytes.iter().enumerate() {
            // Little from here on.
            let at = match self.endian {
                Endian::Little => at,
                Endian::Big => length - 1 - at,
            };
            eight[at] = *byte;
        }
        let bits = u64::from_le_bytes(eight);
        match self.sample {
            SampleType::I8 => f64::from(bits as u8 as i8),
            SampleType::U8 => f64::from(bits as u8),
            SampleType::I16 => f64::from(bits as u16 as i16),
            SampleType::U16 => f64::from(bits as u16),
            SampleType::I32 => f64::from(bits as u32 as i32),
            SampleType::U32 => f64::from(bits as u32),
            SampleType::I64 => bits as i64 as f64,
            SampleType::U64 => bits as f64,
            SampleType::F32 => f64::from(f32::from_bits(bits as u32)),
            SampleType::F64 => f64::from_bits(bits),
        }
    }
}

fn unpack(header: &Header, data: &[u8], said: usize) -> Result<Vec<u8>, VolumeError> {
    let format = header.format;
    let differs = |found: usize| VolumeError::SelfContradicting {
        format,
        said: said as u64,
        found: found as u64,
    };
    let (packed, trailer, is_zlib) = match header.packing {
        Packing::Raw if data.len() == said => return Ok(data.to_vec()),
        Packing::Raw => return Err(differs(data.len())),
        Packing::Gzip => {
            let (packed, trailer) =
                gzip(data).ok_or_else(|| VolumeError::malformed(format, "the data are no gzip"))?;
            (packed, Some(trailer), false)
        }
        Packing::Zlib => (data, None, true),
    };
    let most = packed.len() as u64 * MOST_PER_DEFLATED_BYTE;
    if most < said as u64 {
        return Err(differs(most as usize));
    }
    let mut bytes = vec![0; said];
    match decompress_slice_iter_to_slice(&mut bytes, iter::once(packed), is_zlib, !is_zlib) {
        Ok(found) if found == said => {}
        Ok(found) => return Err(differs(found)),
        Err(miniz_oxide::inflate::TINFLStatus::HasMoreOutput) => return Err(differs(said + 1)),
        Err(_) => {
            return Err(VolumeError::malformed(
                format,
                "the data cannot be unpacked",
            ));
        }
    }
    if trailer.is_some_and(|checksum| checksum != rawzip::crc32(&bytes)) {
        let problem = "the data are not what their checksum says";
        return Err(VolumeError::malformed(format, problem));
    }
    Ok(bytes)
}

/// What is packed in a gzip file of one member, and the checksum behind it.
fn gzip(data: &[u8]) -> Option<(&[u8], u32)> {
    const EXTRA: u8 = 4;
    const NAME: u8 = 8;
    const COMMENT: u8 = 16;
    const HEADER_CHECKSUM: u8 = 2;
    const RESERVED: u8 = 0xE0;
    let (head, mut rest) = data.split_first_chunk::<10>()?;
    let flags = head[3];
    if head[..3] != [0x1F, 0x8B, 8] || flags & RESERVED != 0 {
        return None;
    }
    if flags & EXTRA != 0 {
        let (length, behind) = rest.split_first_chunk::<2>()?;
        rest = behind.get(usize::from(u16::from_le_bytes(*length))..)?;
    }
    for text in [NAME, COMMENT] {
        if flags & text != 0 {
            let end = rest.iter().position(|byte| *byte == 0)?;
            rest = &rest[end + 1..];
        }
    }
    if flags & HEADER_CHECKSUM != 0 {
        rest = rest.get(2..)?;
    }
    let (packed, trailer) = rest.split_last_chunk::<8>()?;
    let checksum = u32::from_le_bytes([trailer[0], trailer[1], trailer[2], trailer[3]]);
    Some((packed, checksum))
}
