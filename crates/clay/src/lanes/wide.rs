//! The same operations with whatever instructions the processor has besides.
//!
//! Newer instructions save moves between registers; they round as the old ones do, and nothing here lets a compiler
//! fuse a multiplication with an addition. So results do not depend on whether a processor has them.
// A function for newer instructions may be called only where the processor has them, and only we can know that.
#![allow(unsafe_code)]

/// Work that spends its time in the operations of this room. `run` must be inlined wherever it is called.
pub(crate) trait Work {
    type Output;

    fn run(self) -> Self::Output;
}

/// Does work with the best instructions there are.
#[inline]
pub(crate) fn widely<W: Work>(work: W) -> W::Output {
    #[cfg(test)]
    if tests::PLAINLY.get() {
        return work.run();
    }
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions.
        return unsafe { with_avx2(work) };
    }
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<W: Work>(work: W) -> W::Output {
    work.run()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use crate::golden;

    thread_local! {
        /// Whether this thread makes do with the instructions that every processor has.
        pub(super) static PLAINLY: Cell<bool> = const { Cell::new(false) };
    }

    #[test]
    fn newer_instructions_give_the_same_bits() {
        let widely = [golden::digest(), golden::rods(), golden::mesh()];
        PLAINLY.set(true);
        let plainly = [golden::digest(), golden::rods(), golden::mesh()];
        PLAINLY.set(false);
        assert_eq!(plainly, widely);
    }
}
