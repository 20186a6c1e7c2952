//! MetaImage, read: a header in lines of `Key = Value` that ends with `ElementDataFile = LOCAL`, then the samples.
//!
//! ```text
//! ObjectType = Image
//! NDims = 3
//! BinaryData = True
//! BinaryDataByteOrderMSB = False                     or ElementByteOrderMSB; little when left out
//! CompressedData = False                             True: zlib
//! TransformMatrix = 1 0 0 0 1 0 0 0 1                a row for each of the file's axes
//! ElementSpacing = 0.4 0.4 0.6                       mm
//! DimSize = 512 512 300                              the fastest axis first
//! ElementType = MET_SHORT
//! ElementDataFile = LOCAL
//! the samples
//! ```
//!
//! Other keys are passed over. Data in another file, text and several channels are refused.

use super::nrrd::along_axes;
use super::samples::{Endian, Header, Packing, SampleType, Volume};
use super::{VolumeError, VolumeFormat};
use crate::error::beginning;

/// Longest header, bytes: a real one has a thousand.
const LONGEST_HEADER: usize = 64 * 1024;

/// Reads a volume.
///
/// # Errors
/// It is no MetaImage, of a kind that is not read, too large, or cut short. The error says what in words.
pub fn read_metaimage(bytes: &[u8]) -> Result<Volume, VolumeError> {
    let mut fields = Fields::default();
    let searched = &bytes[..bytes.len().min(LONGEST_HEADER)];
    let mut from = 0;
    while let Some(length) = searched[from..].iter().position(|byte| *byte == b'\n') {
        let line = std::str::from_utf8(&searched[from..from + length])
            .map_err(|_| problem("the header is not UTF-8"))?;
        from += length + 1;
        let (key, value) = line
            .split_once('=')
            .map(|(key, value)| (key.trim(), value.trim()))
            .ok_or_else(|| problem(format!("a line that is no key: {}", beginning(line))))?;
        if key == "ElementDataFile" {
            if !value.eq_ignore_ascii_case("LOCAL") {
                return Err(problem(format!(
                    "the data are in another file, {}: a detached header is not read",
                    beginning(value)
                )));
            }
            return Volume::read(&fields.header()?, &bytes[from..]);
        }
        fields.take(key, value)?;
    }
    Err(problem("there is no ElementDataFile = LOCAL"))
}

#[derive(Default)]
struct Fields {
    dimensions: Option<u64>,
    sizes: Option<[u64; 3]>,
    spacing: Option<[f64; 3]>,
    matrix: Option<[f64; 9]>,
    sample: Option<SampleType>,
    is_big: bool,
    is_packed: bool,
}

impl Fields {
    fn take(&mut self, key: &str, value: &str) -> Result<(), VolumeError> {
        match key {
            "ObjectType" if value != "Image" => Err(unread(key, value, "Image")),
            "NDims" => put(&mut self.dimensions, key, list::<u64, 1>(key, value)?[0]),
            "DimSize" => put(&mut self.sizes, key, list(key, value)?),
            "ElementSpacing" => put(&mut self.spacing, key, list(key, value)?),
            "TransformMatrix" | "Rotation" | "Orientation" => {
                put(&mut self.matrix, key, list(key, value)?)
            }
            "ElementType" => put(&mut self.sample, key, sample(value)?),
            "BinaryDataByteOrderMSB" | "ElementByteOrderMSB" => {
                self.is_big = truth(key, value)?;
                Ok(())
            }
            "CompressedData" => {
                self.is_packed = truth(key, value)?;
                Ok(())
            }
            "BinaryData" if !truth(key, value)? => Err(unread(key, value, "True")),
            "ElementNumberOfChannels" if value != "1" => Err(unread(key, value, "1")),
            "HeaderSize" if value != "0" => Err(unread(key, value, "data right behind the header")),
            _ => Ok(()),
        }
    }

    fn header(&self) -> Result<Header, VolumeError> {
        if self.dimensions != Some(3) {
            let got = self
                .dimensions
                .map_or("not told".to_owned(), |got| got.to_string());
            return Err(problem(format!("NDims is {got}, wanted 3")));
        }
        let missing = |key: &str| problem(format!("{key} is not told"));
        let spacing_mm = self.spacing.ok_or_else(|| missing("ElementSpacing"))?;
        let steps_mm = self.matrix.map_or_else(
            || along_axes(spacing_mm),
            |matrix| {
                std::array::from_fn(|axis| {
                    std::array::from_fn(|along| matrix[3 * axis + along] * spacing_mm[axis])
                })
            },
        );
        Ok(Header {
            format: VolumeFormat::MetaImage,
            sizes: self.sizes.ok_or_else(|| missing("DimSize"))?,
            steps_m: steps_mm.map(|step| step.map(|along| along * 1e-3)),
            sample: self.sample.ok_or_else(|| missing("ElementType"))?,
            endian: if self.is_big {
                Endian::Big
            } else {
                Endian::Little
            },
            packing: if self.is_packed {
                Packing::Zlib
            } else {
                Packing::Raw
            },
        })
    }
}

fn put<T>(field: &mut Option<T>, key: &str, value: T) -> Result<(), VolumeError> {
    if field.replace(value).is_some() {
        return Err(problem(format!("{key} is told twice")));
    }
    Ok(())
}

fn sample(value: &str) -> Result<SampleType, VolumeError> {
    Ok(match value {
        "MET_CHAR" => SampleType::I8,
        "MET_UCHAR" => SampleType::U8,
        "MET_SHORT" => SampleType::I16,
        "MET_USHORT" => SampleType::U16,
        "MET_INT" => SampleType::I32,
        "MET_UINT" => SampleType::U32,
        "MET_LONG_LONG" => SampleType::I64,
        "MET_ULONG_LONG" => SampleType::U64,
        "MET_FLOAT" => SampleType::F32,
        "MET_DOUBLE" => SampleType::F64,
        _ => return Err(unread("ElementType", value, "a type of number")),
    })
}

fn truth(key: &str, value: &str) -> Result<bool, VolumeError> {
    match value.to_ascii_lowercase().as_str() {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        _ => Err(unread(key, value, "True or False")),
    }
}

fn list<T: Copy + Default + std::str::FromStr, const N: usize>(
    key: &str,
    value: &str,
) -> Result<[T; N], VolumeError> {
    let wanted = || unread(key, value, &format!("{N} numbers"));
    let mut found = [T::default(); N];
    let mut texts = value.split_whitespace();
    for one in &mut found {
        *one = texts
            .next()
            .and_then(|text| text.parse().ok())
            .ok_or_else(wanted)?;
    }
    if texts.next().is_some() {
        return Err(wanted());
    }
    Ok(found)
}

fn unread(key: &str, value: &str, wanted: &str) -> VolumeError {
    problem(format!("{key} is {}, wanted {wanted}", beginning(value)))
}

fn problem(problem: impl Into<std::borrow::Cow<'static, str>>) -> VolumeError {
    VolumeError::malformed(VolumeFormat::MetaImage, problem)
}
