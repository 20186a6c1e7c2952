//! Little-endian cursors. Reading past the end is an error, never a panic.

use crate::FrameError;

/// Reads fields one after the other.
#[derive(Clone)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// Starts at the first byte.
    #[must_use]
    #[inline]
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next bytes, so many.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn slice(&mut self, length: usize) -> Result<&'a [u8], FrameError> {
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

    /// The next `N` bytes.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], FrameError> {
        let mut array = [0; N];
        array.copy_from_slice(self.slice(N)?);
        Ok(array)
    }

    /// The next number.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn u8(&mut self) -> Result<u8, FrameError> {
        self.array().map(u8::from_le_bytes)
    }

    /// The next number.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn u16(&mut self) -> Result<u16, FrameError> {
        self.array().map(u16::from_le_bytes)
    }

    /// The next number.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn u32(&mut self) -> Result<u32, FrameError> {
        self.array().map(u32::from_le_bytes)
    }

    /// The next number.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn u64(&mut self) -> Result<u64, FrameError> {
        self.array().map(u64::from_le_bytes)
    }

    /// The next number.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn f32(&mut self) -> Result<f32, FrameError> {
        self.array().map(f32::from_le_bytes)
    }

    /// The next number.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn f64(&mut self) -> Result<f64, FrameError> {
        self.array().map(f64::from_le_bytes)
    }

    /// The next three numbers.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn f32x3(&mut self) -> Result<[f32; 3], FrameError> {
        Ok([self.f32()?, self.f32()?, self.f32()?])
    }

    /// The next three numbers.
    ///
    /// # Errors
    /// When the message ends before.
    #[inline]
    pub fn f64x3(&mut self) -> Result<[f64; 3], FrameError> {
        Ok([self.f64()?, self.f64()?, self.f64()?])
    }

    /// Zeros that keep the layout aligned. Anything else is an error, so that what decodes also encodes to the same
    /// bytes.
    ///
    /// # Errors
    /// When one is not zero, or the message ends before.
    #[inline]
    pub fn zeros<const N: usize>(&mut self, field: &'static str) -> Result<(), FrameError> {
        if self.array::<N>()? != [0; N] {
            return Err(FrameError::ReservedNotZero { field });
        }
        Ok(())
    }

    /// Ends the message.
    ///
    /// # Errors
    /// When bytes follow.
    #[inline]
    pub fn finish(self) -> Result<(), FrameError> {
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
pub struct Writer<'a> {
    bytes: &'a mut [u8],
    at: usize,
}

impl<'a> Writer<'a> {
    /// Starts at the first byte.
    #[must_use]
    #[inline]
    pub const fn new(bytes: &'a mut [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Writes the next `N` bytes.
    ///
    /// # Panics
    /// When they do not fit.
    #[inline]
    pub fn put<const N: usize>(&mut self, field: [u8; N]) {
        self.bytes[self.at..self.at + N].copy_from_slice(&field);
        self.at += N;
    }

    /// Writes the next bytes.
    ///
    /// # Panics
    /// When they do not fit.
    #[inline]
    pub fn slice(&mut self, bytes: &[u8]) {
        self.bytes[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        self.at += bytes.len();
    }

    /// Writes three numbers.
    ///
    /// # Panics
    /// When they do not fit.
    #[inline]
    pub fn f32x3(&mut self, field: [f32; 3]) {
        for value in field {
            self.put(value.to_le_bytes());
        }
    }

    /// Writes three numbers.
    ///
    /// # Panics
    /// When they do not fit.
    #[inline]
    pub fn f64x3(&mut self, field: [f64; 3]) {
        for value in field {
            self.put(value.to_le_bytes());
        }
    }

    /// Writes three numbers.
    ///
    /// # Panics
    /// When they do not fit.
    #[inline]
    pub fn i32x3(&mut self, field: [i32; 3]) {
        for value in field {
            self.put(value.to_le_bytes());
        }
    }

    /// What was written.
    #[must_use]
    #[inline]
    pub fn finish(self) -> &'a [u8] {
        &self.bytes[..self.at]
    }
}
