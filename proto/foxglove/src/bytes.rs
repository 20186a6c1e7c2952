//! Little-endian fields of binary messages.

/// Why bytes are no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BinaryError {
    /// It has no byte at all.
    #[error("the message is empty")]
    Empty,
    /// Nothing begins with this byte.
    #[error("no message begins with the byte {got}")]
    Opcode {
        /// The first byte.
        got: u8,
    },
    /// A field lies beyond its end.
    #[error("the message has {got} bytes, its fields need {need}")]
    Truncated {
        /// Bytes that are there.
        got: usize,
        /// Bytes that would have to be there.
        need: usize,
    },
    /// A name is not text.
    #[error("the name of the encoding is not UTF-8")]
    NotText,
}

/// Reads field after field.
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(crate) fn opcode(&mut self) -> Result<u8, BinaryError> {
        let opcode = self.bytes.first().copied().ok_or(BinaryError::Empty)?;
        self.at = 1;
        Ok(opcode)
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], BinaryError> {
        let need = self.at.saturating_add(count);
        let taken = self
            .bytes
            .get(self.at..need)
            .ok_or(BinaryError::Truncated {
                got: self.bytes.len(),
                need,
            })?;
        self.at = need;
        Ok(taken)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, BinaryError> {
        self.take(1).map(|taken| taken[0])
    }

    pub(crate) fn u32(&mut self) -> Result<u32, BinaryError> {
        let taken = self.take(4)?;
        Ok(u32::from_le_bytes([taken[0], taken[1], taken[2], taken[3]]))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, BinaryError> {
        let [low, high] = [self.u32()?, self.u32()?];
        Ok(u64::from(low) | u64::from(high) << 32)
    }

    /// A text behind its length.
    pub(crate) fn text(&mut self) -> Result<&'a str, BinaryError> {
        let count = self.u32()? as usize;
        std::str::from_utf8(self.take(count)?).map_err(|_| BinaryError::NotText)
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }
}

/// Puts a text behind its length. The texts of this crate are shorter than 4 GiB.
pub(crate) fn put_text(text: &str, out: &mut Vec<u8>) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}
