//! What tools do to the clay.

use utoipa::ToSchema;

use super::Scheme;
use crate::validate::FieldError;
use crate::word::words;

words! {
    /// What tools do to the clay that they pass through.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Operation: "operation" {
        /// They remove it.
        #[default]
        Cut "cut",
        /// They put clay where none is, within the block, as long as some was removed before.
        Add "add",
        /// They flatten what sticks out and fill what is hollow. The volume stays.
        Smooth "smooth",
    }
}

impl Operation {
    /// Every one.
    pub const ALL: [Self; 3] = [Self::Cut, Self::Add, Self::Smooth];

    /// Whether it is what it is where nobody says anything.
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        matches!(self, Self::Cut)
    }

    /// Whether a scheme can do it: cuts may come in any order, so a copy of the clay can be ahead of the authority;
    /// nothing else may.
    ///
    /// # Errors
    /// The scheme keeps a copy, and this is no cut.
    pub fn check_under(self, scheme: Scheme) -> Result<(), FieldError> {
        if self.is_cut() || !scheme.keeps_a_copy() {
            return Ok(());
        }
        Err(FieldError::new(
            "/operation",
            format!(
                "{self} depends on the order of all that is done to the clay, and scheme {scheme} keeps none: take \
                 another scheme, or cut"
            ),
        ))
    }
}
