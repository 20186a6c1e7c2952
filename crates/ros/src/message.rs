//! What a message is: a name, and fields that are written one behind the other.

use crate::cdr::{Cdr, CdrError, CdrReader};

/// A message of ROS 2.
pub trait Message {
    /// Its full name, such as `geometry_msgs/msg/PoseStamped`.
    const NAME: &'static str;

    /// Writes its fields.
    fn write(&self, cdr: &mut Cdr<'_>);
}

/// A message that can be read as well; texts and bytes of it stay where they are.
pub trait FromCdr<'a>: Message + Sized {
    /// Reads its fields.
    ///
    /// # Errors
    /// The bytes are no such message.
    fn read(cdr: &mut CdrReader<'a>) -> Result<Self, CdrError>;
}

/// Writes a message with its header; what was in `bytes` before is gone.
pub fn to_cdr(message: &impl Message, bytes: &mut Vec<u8>) {
    message.write(&mut Cdr::begin(bytes));
}

/// Reads a message with its header. Bytes behind it are fill, and are passed over.
///
/// # Errors
/// The bytes are no such message.
pub fn from_cdr<'a, M: FromCdr<'a>>(bytes: &'a [u8]) -> Result<M, CdrError> {
    M::read(&mut CdrReader::new(bytes)?)
}

/// What a field of a message can be.
pub(crate) trait Field<'a>: Sized {
    fn put(&self, cdr: &mut Cdr<'_>);
    fn take(cdr: &mut CdrReader<'a>) -> Result<Self, CdrError>;
}

macro_rules! number {
    ($($kind:ident)*) => {$(
        impl Field<'_> for $kind {
            fn put(&self, cdr: &mut Cdr<'_>) {
                cdr.$kind(*self);
            }

            fn take(cdr: &mut CdrReader<'_>) -> Result<Self, CdrError> {
                cdr.$kind()
            }
        }
    )*};
}
number! { bool u8 i32 u32 u64 f64 }

impl<'a> Field<'a> for &'a str {
    fn put(&self, cdr: &mut Cdr<'_>) {
        cdr.text(self);
    }

    fn take(cdr: &mut CdrReader<'a>) -> Result<Self, CdrError> {
        cdr.text()
    }
}

impl<'a> Field<'a> for &'a [u8] {
    fn put(&self, cdr: &mut Cdr<'_>) {
        cdr.bytes(self);
    }

    fn take(cdr: &mut CdrReader<'a>) -> Result<Self, CdrError> {
        cdr.bytes()
    }
}

impl<'a, M: FromCdr<'a>> Field<'a> for M {
    fn put(&self, cdr: &mut Cdr<'_>) {
        self.write(cdr);
    }

    fn take(cdr: &mut CdrReader<'a>) -> Result<Self, CdrError> {
        Self::read(cdr)
    }
}

/// A sequence of messages.
impl<'a, M: FromCdr<'a>> Field<'a> for Vec<M> {
    fn put(&self, cdr: &mut Cdr<'_>) {
        cdr.length(self.len());
        for message in self {
            message.write(cdr);
        }
    }

    fn take(cdr: &mut CdrReader<'a>) -> Result<Self, CdrError> {
        (0..cdr.length()?).map(|_| M::read(cdr)).collect()
    }
}

/// Makes a message of its name and its fields, in their order.
macro_rules! message {
    (
        $(#[$about:meta])*
        $name:literal $type:ident $(<$life:lifetime>)? {
            $($(#[$about_field:meta])* $field:ident: $kind:ty,)*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $type $(<$life>)? {
            $($(#[$about_field])* pub $field: $kind,)*
        }

        impl $(<$life>)? $crate::message::Message for $type $(<$life>)? {
            const NAME: &'static str = $name;

            fn write(&self, cdr: &mut $crate::cdr::Cdr<'_>) {
                $($crate::message::Field::put(&self.$field, cdr);)*
            }
        }

        impl<'a> $crate::message::FromCdr<'a> for $type $(<$life>)? {
            fn read(
                cdr: &mut $crate::cdr::CdrReader<'a>,
            ) -> Result<Self, $crate::cdr::CdrError> {
                Ok(Self {
                    $($field: $crate::message::Field::take(cdr)?,)*
                })
            }
        }
    };
}
pub(crate) use message;
