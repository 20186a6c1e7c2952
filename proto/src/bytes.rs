//! Little-endian cursors. Reading past the end is an error, never a panic.

use crate::FrameError;

/// Reads fields one after the other.
#[derive(Clone)]
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(crate) fn slice(&mut self, length: usize) -> Result<&'a [u8], FrameError> {
        let rest = self.bytes.get(self.at..).unwrap_or(&[]);
        let Some(slice) = rest.get(..length) else {
            return Err(FrameError::TooShort {
                got: self.bytes.len(),
                need: self.at.saturating_add(length),
            });
        };
        self.at += length;
        Ok(slice)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], FrameError> {
        let mut array = [0; N];
        array.copy_from_slice(self.slice(N)?);
        Ok(array)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, FrameError> {
        self.array().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Result<u16, FrameError> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, FrameError> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, FrameError> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn f32(&mut self) -> Result<f32, FrameError> {
        self.array().map(f32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Result<f64, FrameError> {
        self.array().map(f64::from_le_bytes)
    }

    pub(crate) fn f32x3(&mut self) -> Result<[f32; 3], FrameError> {
        Ok([self.f32()?, self.f32()?, self.f32()?])
    }

    pub(crate) fn f64x3(&mut self) -> Result<[f64; 3], FrameError> {
        Ok([self.f64()?, self.f64()?, self.f64()?])
    }

    /// Zeros that keep the layout aligned. Anything else is an error, so that what decodes also encodes to the same
    /// bytes.
    pub(crate) fn zeros<const N: usize>(&mut self, field: &'static str) -> Result<(), FrameError> {
        if self.array::<N>()? != [0; N] {
            return Err(FrameError::ReservedNotZero { field });
        }
        Ok(())
    }

    pub(crate) fn finish(self) -> Result<(), FrameError> {
        if self.at < self.bytes.len() {
            return Err(FrameError::TrailingBytes {
                got: self.bytes.len(),
                want: self.at,
            });
        }
        Ok(())
    }
}

/// Writes fields one after the other into a buffer that is known to be long enough.
pub(crate) struct Writer<'a> {
    bytes: &'a mut [u8],
    at: usize,
}

impl<'a> Writer<'a> {
    pub(crate) const fn new(bytes: &'a mut [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(crate) fn put<const N: usize>(&mut self, field: [u8; N]) {
        self.bytes[self.at..self.at + N].copy_from_slice(&field);
        self.at += N;
    }

    pub(crate) fn slice(&mut self, bytes: &[u8]) {
        self.bytes[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        self.at += bytes.len();
    }

    pub(crate) fn f32x3(&mut self, field: [f32; 3]) {
        for value in field {
            self.put(value.to_le_bytes());
        }
    }

    pub(crate) fn f64x3(&mut self, field: [f64; 3]) {
        for value in field {
            self.put(value.to_le_bytes());
        }
    }

    pub(crate) fn i32x3(&mut self, field: [i32; 3]) {
        for value in field {
            self.put(value.to_le_bytes());
        }
    }

    /// What was written.
    pub(crate) fn finish(self) -> &'a [u8] {
        &self.bytes[..self.at]
    }
}
