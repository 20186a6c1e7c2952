//! Why a message is not heard.

/// Why a message is not heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Forged {
    /// There is no trailer at its end.
    #[error("a message of {got} bytes has no trailer")]
    TooShort {
        /// Its length.
        got: usize,
    },
    /// It was written by somebody else, for something else, or changed on its way.
    #[error("a message that the other side did not write")]
    Unauthentic,
    /// It has come before, or so late that nobody can tell.
    #[error("a message that was heard before")]
    Replayed,
}
