//! Enumerations that travel as one byte or as one lower-case word.

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

/// Declares an enumeration once, with its byte and its word side by side, so that the two cannot drift apart.
macro_rules! words {
    (
        $(#[$meta:meta])*
        pub enum $name:ident: $what:literal {
            $( $(#[$variant_meta:meta])* $variant:ident = $byte:literal $word:literal, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum $name {
            $( $(#[$variant_meta])* $variant = $byte, )+
        }

        impl $name {
            /// Every value, in the order of its byte.
            pub const ALL: &'static [Self] = &[$( Self::$variant, )+];

            /// The word that stands for this value in JSON, logs and arguments.
            #[must_use]
            pub const fn word(self) -> &'static str {
                match self {
                    $( Self::$variant => $word, )+
                }
            }

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
    };
}

pub(crate) use words;
