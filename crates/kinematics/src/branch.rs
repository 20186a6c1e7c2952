//! Which of several solutions is meant.

/// One of the eight inverse solutions, by the signs `K_j` of (10)–(12), one per arm.
///
/// With the platform above the base (`z > 0`), `K_j = -1` puts the elbow of arm `j` outwards; below it, `K_j = +1`
/// does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Branch {
    /// Bit `2 - j` is set where `K_j = -1`, so that branches count like the signs read: `+ + +` first.
    bits: u8,
}

/// Signs that name no branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("branch sign of arm {arm} is {got}, need 1 or -1")]
pub struct BranchError {
    /// Arm, from 1.
    pub arm: usize,
    /// As given.
    pub got: i64,
}

/// One of the two forward solutions, which mirror each other in the plane of the elbows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Assembly {
    /// On the side from which elbows 1, 2, 3 turn counter-clockwise: above, for arms that do so around the base.
    Front,
    /// On the other side.
    Back,
}

impl Branch {
    /// All eight, `(1, 1, 1)` first and `(-1, -1, -1)` last, the third sign changing fastest.
    pub const ALL: [Self; 8] = [
        Self { bits: 0 },
        Self { bits: 1 },
        Self { bits: 2 },
        Self { bits: 3 },
        Self { bits: 4 },
        Self { bits: 5 },
        Self { bits: 6 },
        Self { bits: 7 },
    ];

    /// The branch with these signs.
    ///
    /// # Errors
    /// A sign is neither 1 nor -1.
    pub fn from_signs(signs: [i64; 3]) -> Result<Self, BranchError> {
        let mut bits = 0;
        for (j, &got) in signs.iter().enumerate() {
            match got {
                1 => {}
                -1 => bits |= 4 >> j,
                _ => return Err(BranchError { arm: j + 1, got }),
            }
        }
        Ok(Self { bits })
    }

    /// `K_1, K_2, K_3`.
    #[must_use]
    pub fn signs(self) -> [i64; 3] {
        std::array::from_fn(|j| if self.is_minus(j) { -1 } else { 1 })
    }

    /// Place in [`Branch::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        usize::from(self.bits)
    }

    /// Whether `K` of the arm at `j`, from 0, is -1.
    pub(crate) fn is_minus(self, j: usize) -> bool {
        self.bits & (4 >> j) != 0
    }
}
