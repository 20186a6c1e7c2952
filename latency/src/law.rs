//! Which law couples hand and tool in a cell: a scheme that sessions have, or one of somebody's own.

use std::fmt;
use std::sync::Arc;

use teleclay_link::scheme::Controllers;
use teleclay_proto::Scheme;

/// A scheme that is defined elsewhere, with a word of its own.
pub trait OwnScheme: Controllers {
    /// The word that stands for it in arguments, tables and files; another one than those of the schemes here.
    fn word(&self) -> &'static str;
}

/// What couples hand and tool.
#[derive(Clone, Copy)]
pub enum Law {
    /// A scheme that sessions have.
    Of(Scheme),
    /// One that is defined elsewhere.
    Own(&'static dyn OwnScheme),
}

/// The word under which frames of a scheme of one's own go: its frames need nothing beyond pose and force.
const GOES_UNDER: Scheme = Scheme::ForceExchange;

impl Law {
    /// The word for it in arguments, tables and files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Of(scheme) => scheme.word(),
            Self::Own(own) => own.word(),
        }
    }

    /// The word that the loop's frames carry.
    pub fn goes_under(self) -> Scheme {
        match self {
            Self::Of(scheme) => scheme,
            Self::Own(_) => GOES_UNDER,
        }
    }

    /// Whether the hand feels a copy of the clay that is kept on its side, as far as the table asks for that.
    pub fn keeps_a_copy(self) -> bool {
        matches!(self, Self::Of(scheme) if scheme.keeps_a_copy())
    }

    /// What makes its controllers.
    pub fn controllers(self) -> Arc<dyn Controllers> {
        match self {
            Self::Of(scheme) => Arc::new(scheme),
            Self::Own(own) => Arc::new(own),
        }
    }
}

impl From<Scheme> for Law {
    fn from(scheme: Scheme) -> Self {
        Self::Of(scheme)
    }
}

impl PartialEq for Law {
    fn eq(&self, other: &Self) -> bool {
        self.word() == other.word()
    }
}

impl fmt::Display for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}

impl fmt::Debug for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}
