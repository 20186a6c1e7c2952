//! A selective acknowledgement: what has come beyond the number up to which everything has.

use crate::FrameError;
use teleclay_wire::bytes::{Reader, Writer};

/// Most gaps that one frame names.
pub const MAX_GAPS: usize = 16;

/// Bytes of one gap.
pub(super) const GAP: usize = 4;

/// Numbers that are missing, and those right behind them that have come. Neither is ever 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gap {
    /// So many numbers have not come.
    pub missing: u16,
    /// So many behind them have.
    pub come: u16,
}

/// The gaps behind an acknowledged number `a`, oldest first: `a + 1` is the first number of the first gap, and the next
/// gap begins behind what has come after it. Nothing is said of numbers behind the last one named.
///
/// ```text
///  0         2
///  +---------+------+
///  | missing | come |   as often as the frame says
///  |   u16   | u16  |
///  +---------+------+
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gaps {
    gaps: [Gap; MAX_GAPS],
    count: u8,
}

/// [`MAX_GAPS`] gaps are named already, or this is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a frame names at most {MAX_GAPS} gaps, none of them empty")]
pub struct NoGap;

impl Gaps {
    /// Names the next gap.
    ///
    /// # Errors
    /// There is no room for it, or nothing is missing in it, or nothing has come behind it.
    pub fn push(&mut self, gap: Gap) -> Result<(), NoGap> {
        if gap.missing == 0 || gap.come == 0 {
            return Err(NoGap);
        }
        let free = self.gaps.get_mut(usize::from(self.count)).ok_or(NoGap)?;
        *free = gap;
        self.count += 1;
        Ok(())
    }

    /// Names none.
    pub const fn clear(&mut self) {
        self.count = 0;
        self.gaps = [Gap {
            missing: 0,
            come: 0,
        }; MAX_GAPS];
    }

    /// The gaps, oldest first.
    #[must_use]
    pub fn as_slice(&self) -> &[Gap] {
        &self.gaps[..usize::from(self.count)]
    }

    /// What has come behind `acknowledged`: first and last number of each stretch. Numbers wrap.
    pub fn come_after(&self, acknowledged: u32) -> impl Iterator<Item = [u32; 2]> {
        self.as_slice().iter().scan(acknowledged, |last, gap| {
            let first = last.wrapping_add(1 + u32::from(gap.missing));
            *last = first.wrapping_add(u32::from(gap.come) - 1);
            Some([first, *last])
        })
    }

    pub(super) const fn count(&self) -> u8 {
        self.count
    }

    pub(super) const fn bytes(&self) -> usize {
        GAP * self.count as usize
    }

    pub(super) fn write(&self, writer: &mut Writer<'_>) {
        for gap in self.as_slice() {
            writer.put(gap.missing.to_le_bytes());
            writer.put(gap.come.to_le_bytes());
        }
    }

    pub(super) fn read(count: u8, reader: &mut Reader<'_>) -> Result<Self, FrameError> {
        if MAX_GAPS < usize::from(count) {
            return Err(FrameError::TooMany {
                field: "gaps",
                got: count.into(),
                most: MAX_GAPS as u64,
            });
        }
        let mut gaps = Self::default();
        for _ in 0..count {
            let gap = Gap {
                missing: reader.u16()?,
                come: reader.u16()?,
            };
            // The count was looked at, so it is an empty one.
            gaps.push(gap).map_err(|NoGap| FrameError::UnknownValue {
                field: "length of a gap",
                got: 0,
            })?;
        }
        Ok(gaps)
    }
}
