//! What `--device` asks for.

use std::fmt;
use std::str::FromStr;

use super::{DeviceKind, UnknownDevice};

/// What `--device` asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A device to hold.
    Kind(DeviceKind),
    /// To be told which there are.
    List,
}

impl Default for DeviceChoice {
    fn default() -> Self {
        Self::Kind(DeviceKind::default())
    }
}

impl DeviceChoice {
    /// The device; the default one where a list is asked for.
    pub fn kind(self) -> DeviceKind {
        match self {
            Self::Kind(kind) => kind,
            Self::List => DeviceKind::default(),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kind(kind) => kind.fmt(f),
            Self::List => f.pad("list"),
        }
    }
}

impl FromStr for DeviceChoice {
    type Err = UnknownDevice;

    fn from_str(word: &str) -> Result<Self, UnknownDevice> {
        match word {
            "list" => Ok(Self::List),
            word => word.parse().map(Self::Kind),
        }
    }
}
