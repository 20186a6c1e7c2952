//! Sequence numbers that wrap.

/// Whether sequence number `a` comes after `b`, where numbers wrap from 2³² − 1 to 0.
///
/// At 1 kHz a `u32` wraps after 49.7 days, so plain `<` would stop a long session. Of two numbers less than 2³¹ apart
/// the one ahead is the later; numbers exactly 2³¹ apart are in no order, and neither is after the other.
#[must_use]
pub const fn is_after(a: u32, b: u32) -> bool {
    let ahead = a.wrapping_sub(b);
    0 < ahead && ahead < 1 << 31
}

#[cfg(test)]
mod tests {
    use super::is_after;

    #[test]
    fn numbers_are_ordered_across_the_wrap() {
        assert!(is_after(1, 0));
        assert!(!is_after(0, 1));
        assert!(!is_after(7, 7));
        assert!(is_after(0, u32::MAX));
        assert!(!is_after(u32::MAX, 0));
        assert!(is_after(5, u32::MAX - 5));
    }

    #[test]
    fn opposite_numbers_are_in_no_order() {
        assert!(!is_after(1 << 31, 0));
        assert!(!is_after(0, 1 << 31));
        assert!(is_after((1 << 31) - 1, 0));
    }
}
