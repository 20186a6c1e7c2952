//! Which bricks changed: a set to drain for those who stream, a revision for those who ask, a set of stale hashes.

use crate::grid::BrickIndex;

/// Bookkeeping of changes to the bricks of one clay.
#[derive(Clone, Debug)]
pub(crate) struct Changes {
    /// Bricks that changed since they were last drained.
    dirty: BrickSet,
    /// Bricks that changed since they were last hashed.
    stale: BrickSet,
    /// Clay revision at which each brick last changed; 0 for a fresh one.
    revisions: Vec<u64>,
    /// Grows by one with every call that changed something.
    revision: u64,
}

impl Changes {
    pub(crate) fn none(bricks: usize) -> Self {
        Self {
            dirty: BrickSet::empty(bricks),
            stale: BrickSet::empty(bricks),
            revisions: vec![0; bricks],
            revision: 0,
        }
    }

    /// The revision that changes made from now on belong to. It counts only once something is marked with it.
    pub(crate) const fn upcoming(&self) -> u64 {
        self.revision + 1
    }

    #[inline]
    pub(crate) fn mark(&mut self, brick: usize, revision: u64) {
        if self.revisions[brick] == revision && self.dirty.has(brick) && self.stale.has(brick) {
            return;
        }
        self.revision = revision;
        self.revisions[brick] = revision;
        self.dirty.insert(brick);
        self.stale.insert(brick);
    }

    pub(crate) const fn revision(&self) -> u64 {
        self.revision
    }

    pub(crate) fn brick_revision(&self, brick: usize) -> u64 {
        self.revisions[brick]
    }

    pub(crate) const fn dirty_count(&self) -> usize {
        self.dirty.count
    }

    /// Takes the next brick to drain, in rotating order.
    pub(crate) fn take_dirty(&mut self) -> Option<BrickIndex> {
        self.dirty.take_next().map(BrickIndex::new)
    }

    pub(crate) const fn stale_count(&self) -> usize {
        self.stale.count
    }

    /// Takes the next brick to hash.
    pub(crate) fn take_stale(&mut self) -> Option<usize> {
        self.stale.take_next()
    }

    /// Takes one brick out of those to hash; returns whether it was among them.
    pub(crate) fn unmark_stale(&mut self, brick: usize) -> bool {
        self.stale.remove(brick)
    }
}

/// A set of bricks, one bit each.
#[derive(Clone, Debug)]
struct BrickSet {
    words: Vec<u64>,
    count: usize,
    /// Where the search for the next member starts, so that a busy corner cannot starve the rest.
    cursor: usize,
}

impl BrickSet {
    fn empty(bricks: usize) -> Self {
        Self {
            words: vec![0; bricks.div_ceil(64)],
            count: 0,
            cursor: 0,
        }
    }

    fn has(&self, brick: usize) -> bool {
        self.words[brick / 64] & bit(brick) != 0
    }

    fn insert(&mut self, brick: usize) {
        self.count += usize::from(!self.has(brick));
        self.words[brick / 64] |= bit(brick);
    }

    fn remove(&mut self, brick: usize) -> bool {
        let had = self.has(brick);
        self.count -= usize::from(had);
        self.words[brick / 64] &= !bit(brick);
        had
    }

    fn take_next(&mut self) -> Option<usize> {
        if self.count == 0 {
            return None;
        }
        let words = self.words.len();
        let (start, offset) = (self.cursor / 64, self.cursor % 64);
        // The first word is looked at twice: from the cursor on first, below it last.
        for step in 0..=words {
            let word = (start + step) % words;
            let mask = match step {
                0 => u64::MAX << offset,
                last if last == words => !(u64::MAX << offset),
                _ => u64::MAX,
            };
            let members = self.words[word] & mask;
            if members != 0 {
                let brick = word * 64 + members.trailing_zeros() as usize;
                self.remove(brick);
                self.cursor = (brick + 1) % (words * 64);
                return Some(brick);
            }
        }
        None
    }
}

const fn bit(brick: usize) -> u64 {
    1 << (brick % 64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drain(changes: &mut Changes, most: usize) -> Vec<usize> {
        std::iter::from_fn(|| changes.take_dirty())
            .take(most)
            .map(BrickIndex::dense)
            .collect()
    }

    #[test]
    fn every_brick_is_drained_once_and_merged() {
        let mut changes = Changes::none(130);
        for brick in [129, 0, 64, 63, 0, 129] {
            let revision = changes.upcoming();
            changes.mark(brick, revision);
        }
        assert_eq!(changes.dirty_count(), 4);
        assert_eq!(drain(&mut changes, 99), [0, 63, 64, 129]);
        assert_eq!(changes.dirty_count(), 0);
        assert_eq!(drain(&mut changes, 99), []);
        assert_eq!(changes.revision(), 6);
        assert_eq!(changes.brick_revision(129), 6);
        assert_eq!(changes.brick_revision(63), 4);
        assert_eq!(changes.brick_revision(1), 0);
    }

    #[test]
    fn a_busy_brick_cannot_starve_the_others() {
        let mut changes = Changes::none(100);
        for brick in 0..100 {
            changes.mark(brick, 1);
        }
        let mut seen = Vec::new();
        for _ in 0..100 {
            changes.mark(0, 1);
            seen.extend(drain(&mut changes, 1));
        }
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen, (0..100).collect::<Vec<_>>());
    }

    #[test]
    fn bricks_below_the_cursor_in_its_word_are_found() {
        let mut changes = Changes::none(64);
        changes.mark(40, 1);
        assert_eq!(drain(&mut changes, 1), [40]);
        changes.mark(3, 2);
        assert_eq!(drain(&mut changes, 1), [3]);
    }
}
