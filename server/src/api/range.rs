//! Which part of a file a request asks for: RFC 9110, chapter 14, with one range of bytes. Any other range is passed
//! over, and the whole file is the answer, as a server may.

use std::ops::Range;

use axum::http::{HeaderMap, HeaderValue, header};

/// What is asked for of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    /// All of it.
    Whole,
    /// These bytes.
    Bytes(Range<u64>),
    /// Bytes that it does not have.
    Beyond,
}

impl Asked {
    /// Of a file so long.
    pub(crate) fn of(headers: &HeaderMap, length: u64) -> Self {
        let mut ranges = headers.get_all(header::RANGE).iter();
        match (ranges.next().map(HeaderValue::to_str), ranges.next()) {
            (Some(Ok(text)), None) => read(text, length).unwrap_or(Self::Whole),
            _ => Self::Whole,
        }
    }
}

/// `bytes=first-last`, `bytes=first-` or `bytes=-count`; nothing where it is none of these.
fn read(text: &str, length: u64) -> Option<Asked> {
    let (unit, range) = text.split_once('=')?;
    let (first, last) = range.trim().split_once('-')?;
    if !unit.trim().eq_ignore_ascii_case("bytes") {
        return None;
    }
    let bytes = match (first, last) {
        ("", count) => length.saturating_sub(number(count)?)..length,
        (first, "") => number(first)?..length,
        (first, last) => {
            let (first, last) = (number(first)?, number(last)?);
            if last < first {
                return None;
            }
            first..length.min(last.saturating_add(1))
        }
    };
    Some(if bytes.is_empty() {
        Asked::Beyond
    } else {
        Asked::Bytes(bytes)
    })
}

/// Digits alone: `parse` would take a sign as well.
fn number(text: &str) -> Option<u64> {
    let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
    if is_number { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(range: &str) -> Asked {
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, range.parse().unwrap());
        Asked::of(&headers, 1000)
    }

    #[test]
    fn ranges_are_those_of_the_standard() {
        for (range, wanted) in [
            ("bytes=0-499", Asked::Bytes(0..500)),
            ("bytes=500-999", Asked::Bytes(500..1000)),
            ("bytes=-500", Asked::Bytes(500..1000)),
            ("bytes=9500-", Asked::Beyond),
            ("bytes=990-", Asked::Bytes(990..1000)),
            ("bytes=0-0", Asked::Bytes(0..1)),
            ("bytes=-1", Asked::Bytes(999..1000)),
            ("Bytes=990-5000", Asked::Bytes(990..1000)),
            ("bytes=-5000", Asked::Bytes(0..1000)),
            ("bytes=1000-1000", Asked::Beyond),
            ("bytes=-0", Asked::Beyond),
            // None of one range of bytes: passed over.
            ("bytes=5-2", Asked::Whole),
            ("bytes=0-0,-1", Asked::Whole),
            ("bytes=+1-2", Asked::Whole),
            ("bytes=-", Asked::Whole),
            ("lines=0-1", Asked::Whole),
            ("bytes=99999999999999999999-", Asked::Whole),
            ("bytes", Asked::Whole),
        ] {
            assert_eq!(asked(range), wanted, "{range}");
        }
        assert_eq!(Asked::of(&HeaderMap::new(), 1000), Asked::Whole);
    }
}
