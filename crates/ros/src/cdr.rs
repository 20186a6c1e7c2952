//! Classic CDR (XCDR1), little-endian: a header of four bytes, then every number at a multiple of its own size, counted
//! from behind the header. Strings carry their length with the zero that ends them, sequences the number of elements.

/// Says "classic CDR, little-endian, no options".
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Writes values behind one another.
#[derive(Debug)]
pub struct Cdr<'a> {
    bytes: &'a mut Vec<u8>,
}

impl<'a> Cdr<'a> {
    /// Begins anew: what was in `bytes` is gone, the memory is kept.
    pub fn begin(bytes: &'a mut Vec<u8>) -> Self {
        bytes.clear();
        bytes.extend(HEADER);
        Self { bytes }
    }

    /// A byte.
    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// A truth, one byte.
    pub fn bool(&mut self, value: bool) {
        self.u8(value.into());
    }

    /// Four bytes, signed.
    pub fn i32(&mut self, value: i32) {
        self.aligned(value.to_le_bytes());
    }

    /// Four bytes.
    pub fn u32(&mut self, value: u32) {
        self.aligned(value.to_le_bytes());
    }

    /// Eight bytes.
    pub fn u64(&mut self, value: u64) {
        self.aligned(value.to_le_bytes());
    }

    /// A double.
    pub fn f64(&mut self, value: f64) {
        self.aligned(value.to_le_bytes());
    }

    /// A text. It ends where it has a zero byte: the other side ends it there.
    pub fn text(&mut self, value: &str) {
        let value = value.split('\0').next().unwrap_or_default();
        self.length(value.len() + 1);
        self.bytes.extend(value.as_bytes());
        self.bytes.push(0);
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self, value: &[u8]) {
        self.length(value.len());
        self.bytes.extend(value);
    }

    /// How many elements follow.
    ///
    /// # Panics
    /// There are 2³² or more.
    pub fn length(&mut self, elements: usize) {
        self.u32(u32::try_from(elements).expect("a message is shorter than 4 GiB"));
    }

    fn aligned<const N: usize>(&mut self, value: [u8; N]) {
        let behind_header = self.bytes.len() - HEADER.len();
        let filled = HEADER.len() + behind_header.next_multiple_of(N);
        self.bytes.resize(filled, 0);
        self.bytes.extend(value);
    }
}

/// Why bytes are no message of the wanted type.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// Another encoding, or no message at all.
    #[error("a message begins with {got:02x?}, want {HEADER:02x?}")]
    Header {
        /// Its first bytes, four at most.
        got: Vec<u8>,
    },
    /// A value ends behind the message.
    #[error("a message has {got} bytes, its next value needs {need}")]
    Truncated {
        /// Length of the message.
        got: usize,
        /// Where the value would end.
        need: usize,
    },
    /// A text is in another encoding, or does not end with a zero.
    #[error("the text before byte {at} is no UTF-8 that a zero ends")]
    Text {
        /// Where the text ends.
        at: usize,
    },
    /// A truth that is neither.
    #[error("byte {at} is {got}, want 0 or 1")]
    Truth {
        /// Where it stands.
        at: usize,
        /// What it is.
        got: u8,
    },
}

/// Reads values behind one another. It never allocates more than the message has bytes.
#[derive(Clone, Copy, Debug)]
pub struct CdrReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    /// Begins behind the header.
    ///
    /// # Errors
    /// The bytes begin otherwise.
    pub fn new(bytes: &'a [u8]) -> Result<Self, CdrError> {
        // The last two bytes are options, which mean nothing in this encoding.
        if bytes.len() < HEADER.len() || bytes[..2] != HEADER[..2] {
            return Err(CdrError::Header {
                got: bytes.iter().copied().take(HEADER.len()).collect(),
            });
        }
        Ok(Self {
            bytes,
            at: HEADER.len(),
        })
    }

    /// A byte.
    ///
    /// # Errors
    /// The message ends before, as for every other value.
    pub fn u8(&mut self) -> Result<u8, CdrError> {
        Ok(self.take(1)?[0])
    }

    /// A truth.
    ///
    /// # Errors
    /// The byte is neither 0 nor 1.
    pub fn bool(&mut self) -> Result<bool, CdrError> {
        let at = self.at;
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            got => Err(CdrError::Truth { at, got }),
        }
    }

    /// Four bytes, signed.
    ///
    /// # Errors
    /// The message ends before.
    pub fn i32(&mut self) -> Result<i32, CdrError> {
        self.aligned().map(i32::from_le_bytes)
    }

    /// Four bytes.
    ///
    /// # Errors
    /// The message ends before.
    pub fn u32(&mut self) -> Result<u32, CdrError> {
        self.aligned().map(u32::from_le_bytes)
    }

    /// Eight bytes.
    ///
    /// # Errors
    /// The message ends before.
    pub fn u64(&mut self) -> Result<u64, CdrError> {
        self.aligned().map(u64::from_le_bytes)
    }

    /// A double.
    ///
    /// # Errors
    /// The message ends before.
    pub fn f64(&mut self) -> Result<f64, CdrError> {
        self.aligned().map(f64::from_le_bytes)
    }

    /// A text.
    ///
    /// # Errors
    /// It is no UTF-8, or no zero ends it.
    pub fn text(&mut self) -> Result<&'a str, CdrError> {
        let bytes = self.bytes()?;
        let text = match bytes {
            // Some write an empty text without its zero.
            [] => Some(""),
            [text @ .., 0] => str::from_utf8(text).ok(),
            _ => None,
        };
        text.ok_or(CdrError::Text { at: self.at })
    }

    /// A sequence of bytes.
    ///
    /// # Errors
    /// The message ends before.
    pub fn bytes(&mut self) -> Result<&'a [u8], CdrError> {
        let length = self.length()?;
        self.take(length)
    }

    /// How many elements follow.
    ///
    /// # Errors
    /// The message has fewer bytes left.
    pub fn length(&mut self) -> Result<usize, CdrError> {
        let length = self.u32()? as usize;
        self.clone().take(length)?;
        Ok(length)
    }

    fn aligned<const N: usize>(&mut self) -> Result<[u8; N], CdrError> {
        self.at = HEADER.len() + (self.at - HEADER.len()).next_multiple_of(N);
        let bytes = self.take(N)?;
        Ok(bytes.try_into().expect("it has just that many"))
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], CdrError> {
        let need = self.at.saturating_add(length);
        let bytes = self.bytes.get(self.at..need).ok_or(CdrError::Truncated {
            got: self.bytes.len(),
            need,
        })?;
        self.at = need;
        Ok(bytes)
    }
}
