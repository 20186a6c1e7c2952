//! The one error of every binary decoder.

/// Why bytes are not the message that was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The message ends before its layout does.
    #[error("message has {got} bytes, its layout needs {need}")]
    TooShort {
        /// Bytes that came.
        got: usize,
        /// Least number of bytes that would have been enough to read on.
        need: usize,
    },
    /// Bytes follow after the end of the layout.
    #[error("message has {got} bytes, its layout ends after {want}")]
    TrailingBytes {
        /// Bytes that came.
        got: usize,
        /// Bytes that the layout has.
        want: usize,
    },
    /// The first two bytes are not the family's magic.
    #[error("message starts with {got:?}, wanted {want:?}")]
    WrongMagic {
        /// Bytes that came.
        got: [u8; 2],
        /// The family's magic.
        want: [u8; 2],
    },
    /// The layout is of another version.
    #[error("message has version {got}, this side speaks {want}")]
    WrongVersion {
        /// Version that came.
        got: u8,
        /// The only version that is understood.
        want: u8,
    },
    /// A good message of another kind.
    #[error("message is of kind {got}, wanted {want}")]
    WrongKind {
        /// Kind that came.
        got: u8,
        /// Kind that was asked for.
        want: u8,
    },
    /// A byte that names no value of its enumeration.
    #[error("byte {got} is not a {field}")]
    UnknownValue {
        /// What the byte should have named.
        field: &'static str,
        /// The byte that came.
        got: u8,
    },
    /// Bytes or bits that this version leaves at zero were not zero.
    #[error("reserved bits of {field} are not zero")]
    ReservedNotZero {
        /// Where they stand.
        field: &'static str,
    },
    /// A list is longer than its layout allows.
    #[error("{field} has {got} entries, at most {most} fit")]
    TooMany {
        /// Which list.
        field: &'static str,
        /// Entries announced.
        got: u64,
        /// Entries allowed.
        most: u64,
    },
    /// A brick's index lies outside of the grid that the same message describes.
    #[error("brick {index} lies outside of a grid of {bricks} bricks")]
    BrickOutsideGrid {
        /// Index that came.
        index: u32,
        /// Bricks of the grid.
        bricks: u64,
    },
    /// A packed brick does not expand to exactly one brick's voxels.
    #[error("packed brick expands to {got} voxels, wanted {want}")]
    WrongVoxelCount {
        /// Voxels the tokens stand for, counted until the error was certain.
        got: usize,
        /// Voxels of a brick.
        want: usize,
    },
    /// An empty or full brick carries bytes.
    #[error("brick of kind {kind} carries {got} bytes, wanted none")]
    WrongBrickLength {
        /// Kind of the brick.
        kind: u8,
        /// Bytes it carries.
        got: usize,
    },
}
