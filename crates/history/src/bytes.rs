//! Numbers and texts as bytes: small numbers take few.

use std::sync::Arc;

/// Bytes that are not what they should be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// They end too early.
    #[error("the bytes end within {what}")]
    Short {
        /// What ends.
        what: &'static str,
    },
    /// A value that cannot be.
    #[error("{what} is {got}")]
    Value {
        /// What it is.
        what: &'static str,
        /// Its value.
        got: u64,
    },
    /// A later program wrote them.
    #[error("version {got} is newer than {want}, the newest that this program reads")]
    Newer {
        /// The version.
        got: u8,
        /// The newest that is read.
        want: u8,
    },
    /// A text that is none, or says what cannot be.
    #[error("{what}: {why}")]
    Text {
        /// What it is.
        what: &'static str,
        /// What is wrong.
        why: String,
    },
}

/// Seven bits a byte, the lowest first.
pub(crate) fn put_number(out: &mut Vec<u8>, mut number: u64) {
    while 0x80 <= number {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// Likewise, with numbers near zero on both sides short.
pub(crate) fn put_signed(out: &mut Vec<u8>, number: i32) {
    let folded = (number << 1) ^ (number >> 31);
    put_number(out, u64::from(folded as u32));
}

/// Its length, then itself.
pub(crate) fn put_text(out: &mut Vec<u8>, text: &[u8]) {
    put_number(out, text.len() as u64);
    out.extend_from_slice(text);
}

/// Reads what the above have written.
#[derive(Clone)]
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// How many bytes are left.
    pub(crate) fn left(&self) -> usize {
        self.rest.len()
    }

    pub(crate) fn byte(&mut self, what: &'static str) -> Result<u8, Malformed> {
        let (first, rest) = self.rest.split_first().ok_or(Malformed::Short { what })?;
        self.rest = rest;
        Ok(*first)
    }

    pub(crate) fn slice(
        &mut self,
        length: usize,
        what: &'static str,
    ) -> Result<&'a [u8], Malformed> {
        let split = self.rest.split_at_checked(length);
        let (slice, rest) = split.ok_or(Malformed::Short { what })?;
        self.rest = rest;
        Ok(slice)
    }

    pub(crate) fn number(&mut self, what: &'static str) -> Result<u64, Malformed> {
        let mut number = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte(what)?;
            let part = u64::from(byte & 0x7F);
            if 1 << (64 - shift).min(7) <= part && shift == 63 {
                return Err(Malformed::Value { what, got: part });
            }
            number |= part << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(Malformed::Value { what, got: number })
    }

    pub(crate) fn small<T: TryFrom<u64>>(&mut self, what: &'static str) -> Result<T, Malformed> {
        let got = self.number(what)?;
        T::try_from(got).map_err(|_| Malformed::Value { what, got })
    }

    pub(crate) fn signed(&mut self, what: &'static str) -> Result<i32, Malformed> {
        let folded: u32 = self.small(what)?;
        Ok((folded >> 1) as i32 ^ -((folded & 1) as i32))
    }

    pub(crate) fn text(&mut self, what: &'static str) -> Result<&'a [u8], Malformed> {
        let length = self.small(what)?;
        self.slice(length, what)
    }

    pub(crate) fn string(&mut self, what: &'static str) -> Result<String, Malformed> {
        let text = std::str::from_utf8(self.text(what)?);
        let text = text.map_err(|error| Malformed::Text {
            what,
            why: error.to_string(),
        })?;
        Ok(text.to_owned())
    }

    pub(crate) fn shared(&mut self, what: &'static str) -> Result<Arc<str>, Malformed> {
        self.string(what).map(Arc::from)
    }

    pub(crate) fn version(&mut self, want: u8) -> Result<u8, Malformed> {
        match self.byte("the version")? {
            0 => Err(Malformed::Value {
                what: "the version",
                got: 0,
            }),
            got if want < got => Err(Malformed::Newer { got, want }),
            got => Ok(got),
        }
    }
}
