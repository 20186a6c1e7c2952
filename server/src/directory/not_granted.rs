//! Why somebody gets no tool.

use teleclay_proto::join::RefusalCode;

/// A join that is not granted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NotGranted {
    pub(crate) code: RefusalCode,
    /// For people.
    pub(crate) reason: String,
    /// Who stands in the way.
    pub(crate) holder: Option<String>,
}

impl NotGranted {
    pub(super) const fn because(code: RefusalCode, reason: String) -> Self {
        Self {
            code,
            reason,
            holder: None,
        }
    }
}
