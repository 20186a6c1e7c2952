//! Lists of what to look at in a brick, made without branches.

/// Entries that are written at a time.
const BATCH: usize = 4;
/// Most entries: the tiles of a brick.
const MOST: usize = 256;

/// Numbers below [`MOST`], in the order in which they came.
pub(super) struct List {
    entries: [u8; MOST + BATCH],
    len: usize,
}

impl List {
    pub(super) fn new() -> Self {
        Self {
            entries: [0; MOST + BATCH],
            len: 0,
        }
    }

    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds those of the four numbers from `first` on, a multiple of four, of which the bit is set. Takes up to
    /// [`MOST`] in all.
    #[inline(always)]
    pub(super) fn push(&mut self, first: usize, bits: u32) {
        let (numbers, count) = CHOSEN[bits as usize & 0xF];
        // Four are written, and as many as were chosen count: that costs less than a branch that cannot be foreseen.
        let batch = numbers | (first as u32 & 0xFC).wrapping_mul(0x0101_0101);
        let at = self.len.min(MOST);
        self.entries[at..at + BATCH].copy_from_slice(&batch.to_le_bytes());
        self.len = at + count as usize;
    }

    #[inline(always)]
    pub(super) fn entries(&self) -> &[u8] {
        &self.entries[..self.len.min(MOST)]
    }
}

/// For each choice of four, the chosen, a byte each, and how many.
const CHOSEN: [(u32, u32); 16] = {
    let mut chosen = [(0, 0); 16];
    let mut bits = 0;
    while bits < 16 {
        let (mut numbers, mut count, mut at) = (0, 0, 0);
        while at < 4 {
            if bits >> at & 1 != 0 {
                numbers |= at << (8 * count);
                count += 1;
            }
            at += 1;
        }
        chosen[bits] = (numbers, count);
        bits += 1;
    }
    chosen
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_is_listed_in_order() {
        let mut list = List::new();
        let mut want = Vec::new();
        for (at, bits) in (0..64).map(|at| (at, at as u32 * 7 % 16)) {
            list.push(4 * at, bits);
            want.extend(
                (0..4)
                    .filter(|lane| bits >> lane & 1 != 0)
                    .map(|lane| (4 * at + lane) as u8),
            );
        }
        assert_eq!(list.entries(), want);
    }

    #[test]
    fn a_brick_of_tiles_fits() {
        let mut list = List::new();
        for at in 0..64 {
            list.push(4 * at, 0xF);
        }
        assert_eq!(list.entries(), (0..=255).collect::<Vec<u8>>());
    }
}
