//! NRRD, read: a header in lines of text, an empty line, the samples.
//!
//! ```text
//! NRRD0004                                           1 to 5
//! # a comment
//! type: short                                        a number type, not block
//! dimension: 3
//! sizes: 512 512 300                                 the fastest axis first
//! spacings: 0.4 0.4 0.6                              or space directions, (0.4,0,0) (0,0.4,0) (0,0,0.6)
//! space units: "mm" "mm" "mm"                        or m, cm, um; mm when left out
//! encoding: gzip                                     raw, gzip or gz
//! endian: little                                     or big; where a sample has several bytes
//! key:=value                                         is passed over, as other fields are
//!
//! the samples
//! ```
//!
//! A `data file` elsewhere is refused, and so is data that does not begin right behind the header. Where the volume
//! lies in the space of a patient does not matter here: of directions only the way along an axis is used, and the
//! origin is not.

use super::samples::{Endian, Header, Packing, SampleType, Volume};
use super::{VolumeError, VolumeFormat};
use crate::error::beginning;

/// Longest header, bytes: a real one has a thousand.
const LONGEST_HEADER: usize = 64 * 1024;

/// Reads a volume.
///
/// # Errors
/// It is no NRRD, of a kind that is not read, too large, or cut short. The error says what in words.
pub fn read_nrrd(bytes: &[u8]) -> Result<Volume, VolumeError> {
    let (header, data) = head(bytes)?;
    let mut fields = Fields::default();
    for line in header.lines().skip(1) {
        let line = line.trim_end_matches('\r');
        if line.starts_with('#') || line.contains(":=") {
            continue;
        }
        let (name, value) = line
            .split_once(':')
            .ok_or_else(|| problem(format!("a line that is no field: {}", beginning(line))))?;
        fields.take(name.trim().to_ascii_lowercase().as_str(), value.trim())?;
    }
    Volume::read(&fields.header()?, data)
}

/// The header as text, and what is behind it.
fn head(bytes: &[u8]) -> Result<(&str, &[u8]), VolumeError> {
    let is_nrrd = bytes.starts_with(b"NRRD000")
        && bytes
            .get(7)
            .is_some_and(|version| (b'1'..=b'5').contains(version));
    if !is_nrrd {
        return Err(problem("it does not begin with NRRD0001 to NRRD0005"));
    }
    let searched = &bytes[..bytes.len().min(LONGEST_HEADER)];
    let mut from = 0;
    while let Some(length) = searched[from..].iter().position(|byte| *byte == b'\n') {
        let line = &searched[from..from + length];
        let next = from + length + 1;
        if line.is_empty() || line == b"\r" {
            let header = std::str::from_utf8(&bytes[..from])
                .map_err(|_| problem("the header is not UTF-8"))?;
            return Ok((header, &bytes[next..]));
        }
        from = next;
    }
    Err(problem(
        "there is no empty line behind the header: the data of a detached header are not here, and are not read",
    ))
}

#[derive(Default)]
struct Fields {
    sample: Option<SampleType>,
    dimension: Option<u64>,
    sizes: Option<[u64; 3]>,
    spacings: Option<[f64; 3]>,
    directions: Option<[[f64; 3]; 3]>,
    unit_m: Option<f64>,
    packing: Option<Packing>,
    endian: Option<Endian>,
}

impl Fields {
    fn take(&mut self, name: &str, value: &str) -> Result<(), VolumeError> {
        match name {
            "type" => put(&mut self.sample, name, sample(value)?),
            "dimension" => put(&mut self.dimension, name, number(name, value)?),
            "sizes" => put(&mut self.sizes, name, three(name, value, number)?),
            "spacings" => put(&mut self.spacings, name, three(name, value, real)?),
            "space directions" => put(&mut self.directions, name, directions(value)?),
            "units" | "space units" => put(&mut self.unit_m, name, unit_m(value)?),
            "encoding" => put(&mut self.packing, name, packing(value)?),
            "endian" => put(&mut self.endian, name, endian(value)?),
            "data file" | "datafile" => Err(problem(format!(
                "the data are in another file, {}: a detached header is not read",
                beginning(value)
            ))),
            "line skip" | "lineskip" | "byte skip" | "byteskip" if value != "0" => {
                Err(problem(format!(
                    "{name} is {}, wanted data right behind the header",
                    beginning(value)
                )))
            }
            _ => Ok(()),
        }
    }

    fn header(&self) -> Result<Header, VolumeError> {
        if self.dimension != Some(3) {
            let got = self
                .dimension
                .map_or("not told".to_owned(), |got| got.to_string());
            return Err(problem(format!("the dimension is {got}, wanted 3")));
        }
        let sample = self.sample.ok_or_else(|| missing("type"))?;
        let endian = match self.endian {
            Some(endian) => endian,
            None if sample.bytes() == 1 => Endian::Little,
            None => return Err(missing("endian")),
        };
        let unit_m = self.unit_m.unwrap_or(1e-3);
        let steps = match (self.directions, self.spacings) {
            (Some(directions), _) => directions,
            (None, Some(spacings)) => along_axes(spacings),
            (None, None) => {
                return Err(problem("neither spacings nor space directions are told"));
            }
        };
        Ok(Header {
            format: VolumeFormat::Nrrd,
            sizes: self.sizes.ok_or_else(|| missing("sizes"))?,
            steps_m: steps.map(|step| step.map(|along| along * unit_m)),
            sample,
            endian,
            packing: self.packing.ok_or_else(|| missing("encoding"))?,
        })
    }
}

/// Steps along x, y, z in their order.
pub(super) fn along_axes(spacings: [f64; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|axis| {
        std::array::from_fn(|along| if axis == along { spacings[axis] } else { 0.0 })
    })
}

fn put<T>(field: &mut Option<T>, name: &str, value: T) -> Result<(), VolumeError> {
    if field.replace(value).is_some() {
        return Err(problem(format!("{name} is told twice")));
    }
    Ok(())
}

fn sample(value: &str) -> Result<SampleType, VolumeError> {
    Ok(match value {
        "signed char" | "int8" | "int8_t" => SampleType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            SampleType::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => {
            SampleType::U16
        }
        "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => SampleType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            SampleType::U64
        }
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => return Err(unread("type", value, "a type of number")),
    })
}

fn packing(value: &str) -> Result<Packing, VolumeError> {
    match value.to_ascii_lowercase().as_str() {
        "raw" => Ok(Packing::Raw),
        "gzip" | "gz" => Ok(Packing::Gzip),
        _ => Err(unread("encoding", value, "raw or gzip")),
    }
}

fn endian(value: &str) -> Result<Endian, VolumeError> {
    match value {
        "little" => Ok(Endian::Little),
        "big" => Ok(Endian::Big),
        _ => Err(unread("endian", value, "little or big")),
    }
}

fn unit_m(value: &str) -> Result<f64, VolumeError> {
    let mut units = value.split_whitespace().map(|unit| unit.trim_matches('"'));
    let first = units.next().unwrap_or_default();
    if units.any(|unit| unit != first) {
        return Err(unread("units", value, "one unit for all axes"));
    }
    match first {
        "m" => Ok(1.0),
        "cm" => Ok(1e-2),
        "mm" | "" => Ok(1e-3),
        "um" | "µm" | "micron" | "microns" => Ok(1e-6),
        _ => Err(unread("units", value, "m, cm, mm or um")),
    }
}

fn directions(value: &str) -> Result<[[f64; 3]; 3], VolumeError> {
    let wanted = || unread("space directions", value, "three vectors, (x,y,z)");
    let mut vectors = value.split(')');
    let mut found = [[0.0; 3]; 3];
    for vector in &mut found {
        let text = vectors
            .next()
            .and_then(|text| text.trim().strip_prefix('('));
        let mut parts = text.ok_or_else(wanted)?.split(',');
        for along in vector.iter_mut() {
            *along = real("space directions", parts.next().ok_or_else(wanted)?.trim())?;
        }
        if parts.next().is_some() {
            return Err(wanted());
        }
    }
    if vectors.any(|rest| !rest.trim().is_empty()) {
        return Err(wanted());
    }
    Ok(found)
}

fn three<T: Copy + Default>(
    name: &str,
    value: &str,
    read: impl Fn(&str, &str) -> Result<T, VolumeError>,
) -> Result<[T; 3], VolumeError> {
    let mut texts = value.split_whitespace();
    let mut found = [T::default(); 3];
    for one in &mut found {
        let text = texts
            .next()
            .ok_or_else(|| unread(name, value, "three numbers"))?;
        *one = read(name, text)?;
    }
    if texts.next().is_some() {
        return Err(unread(name, value, "three numbers"));
    }
    Ok(found)
}

fn number(name: &str, text: &str) -> Result<u64, VolumeError> {
    text.parse()
        .map_err(|_| unread(name, text, "a whole number"))
}

fn real(name: &str, text: &str) -> Result<f64, VolumeError> {
    text.parse().map_err(|_| unread(name, text, "a number"))
}

fn unread(name: &str, value: &str, wanted: &str) -> VolumeError {
    problem(format!("{name} is {}, wanted {wanted}", beginning(value)))
}

fn missing(name: &str) -> VolumeError {
    problem(format!("{name} is not told"))
}

fn problem(problem: impl Into<std::borrow::Cow<'static, str>>) -> VolumeError {
    VolumeError::malformed(VolumeFormat::Nrrd, problem)
}
