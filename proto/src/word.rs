//! Enumerations that travel as one byte or as one lower-case word.
//!
//! A word is read from a text and from nothing else. What serde derives for an enumeration also takes an object of one
//! field for the word that is the field's name.

use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

use serde::de::{Deserializer, Error, Visitor};

/// A word that names none of the values it could.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` is not a {what}, wanted one of {wanted:?}")]
pub struct UnknownWord {
    /// What the word should have named, such as `scheme`.
    pub what: &'static str,
    /// The word that came.
    pub got: String,
    /// Every word that would have done.
    pub wanted: &'static [&'static str],
}

/// Declares an enumeration once, with its word, and with its byte where it has one, side by side, so that they cannot
/// drift apart.
macro_rules! words {
    (
        $(#[$meta:meta])*
        $vis:vis enum $name:ident: $what:literal {
            $( $(#[$variant_meta:meta])* $variant:ident = $byte:literal $word:literal, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        $vis enum $name {
            $( $(#[$variant_meta])* $variant = $byte, )+
        }

        impl $name {
            /// Every value, in the order of its byte.
            pub const ALL: &'static [Self] = &[$( Self::$variant, )+];

            /// The byte that stands for this value in a frame.
            #[must_use]
            pub const fn byte(self) -> u8 {
                self as u8
            }

            pub(crate) const fn from_byte(byte: u8) -> Result<Self, $crate::FrameError> {
                match byte {
                    $( $byte => Ok(Self::$variant), )+
                    got => Err($crate::FrameError::UnknownValue { field: $what, got }),
                }
            }
        }

        $crate::word::words!(@text [$vis] $name: $what { $( $variant $word, )+ });
    };
    (
        $(#[$meta:meta])*
        $vis:vis enum $name:ident: $what:literal {
            $( $(#[$variant_meta:meta])* $variant:ident $word:literal, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        $vis enum $name {
            $( $(#[$variant_meta])* $variant, )+
        }

        $crate::word::words!(@text [$vis] $name: $what { $( $variant $word, )+ });
    };
    (@text [$vis:vis] $name:ident: $what:literal { $( $variant:ident $word:literal, )+ }) => {
        impl $name {
            /// The word that stands for this value in JSON, logs and arguments.
            #[must_use]
            $vis const fn word(self) -> &'static str {
                match self {
                    $( Self::$variant => $word, )+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.word())
            }
        }

        impl std::str::FromStr for $name {
            type Err = $crate::UnknownWord;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                match word {
                    $( $word => Ok(Self::$variant), )+
                    _ => Err($crate::UnknownWord {
                        what: $what,
                        got: word.to_owned(),
                        wanted: &[$( $word, )+],
                    }),
                }
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.word())
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                $crate::word::read(deserializer, &[$( $word, )+])
            }
        }
    };
}

pub(crate) use words;

/// Reads a word; `wanted` are those that there are.
pub(crate) fn read<'de, D, T>(
    deserializer: D,
    wanted: &'static [&'static str],
) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr<Err = UnknownWord>,
{
    deserializer.deserialize_str(OneOf {
        wanted,
        value: PhantomData,
    })
}

struct OneOf<T> {
    wanted: &'static [&'static str],
    value: PhantomData<T>,
}

impl<T: FromStr<Err = UnknownWord>> Visitor<'_> for OneOf<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "one of {:?}", self.wanted)
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<T, E> {
        word.parse().map_err(E::custom)
    }
}
