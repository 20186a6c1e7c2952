//! A scheme that was made elsewhere.

use std::sync::Arc;

use teleclay_link::scheme::Controllers;
use teleclay_proto::Scheme;

/// Such a scheme, and the word that stands for it in frames and settings.
pub(super) struct OwnScheme {
    pub(super) goes_under: Scheme,
    pub(super) controllers: Arc<dyn Controllers>,
}

/// What makes the controllers of the scheme in force.
pub(super) fn controllers<'a>(
    own: Option<&'a OwnScheme>,
    scheme: &'a Scheme,
) -> &'a dyn Controllers {
    match own {
        Some(own) if own.goes_under == *scheme => &*own.controllers,
        _ => scheme,
    }
}
