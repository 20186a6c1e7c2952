//! Schemas of lists and numbers that stand in more than one place, or have bounds that no attribute can name.
//!
//! Nothing is ever of these types: a field names one as its `value_type`.

use std::borrow::Cow;
use std::ops::RangeInclusive;

use utoipa::openapi::schema::{ArrayBuilder, ArrayItems, ObjectBuilder, Schema, Type};
use utoipa::openapi::{Object, Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

/// Edge of a block.
pub(crate) const EDGE_M: RangeInclusive<f64> = 1e-5..=10.0;
/// Where something on a block may be.
pub(crate) const PLACE_M: RangeInclusive<f64> = 0.0..=10.0;

/// A number within a range.
pub(crate) fn number(range: RangeInclusive<f64>) -> ObjectBuilder {
    let (least, most) = range.into_inner();
    ObjectBuilder::new()
        .schema_type(Type::Number)
        .minimum(Some(least))
        .maximum(Some(most))
}

fn any_number() -> Object {
    ObjectBuilder::new().schema_type(Type::Number).build()
}

fn list(items: impl Into<ArrayItems>, length: usize) -> ArrayBuilder {
    ArrayBuilder::new()
        .items(items)
        .min_items(Some(length))
        .max_items(Some(length))
}

macro_rules! schemas {
    ($($(#[doc = $text:literal])+ $name:ident: $schema:expr;)+) => {
        $(
            $(#[doc = $text])+
            pub(crate) enum $name {}

            impl PartialSchema for $name {
                fn schema() -> RefOr<Schema> {
                    let text = concat!($($text),+).trim();
                    RefOr::T(Schema::from(($schema).description(Some(text)).build()))
                }
            }

            impl ToSchema for $name {
                fn name() -> Cow<'static, str> {
                    Cow::Borrowed(stringify!($name))
                }
            }
        )+
    };
}

schemas! {
    /// Three numbers, one for each axis or each arm.
    Vector: list(any_number(), 3);
    /// A place as x, y and z, m.
    Position: list(number(-1e9..=1e9), 3);
    /// Two corners of a box, the least first, m.
    Region: list(Ref::from_schema_name("Position"), 2);
    /// Three rows of a matrix, or one place for each of three arms.
    Matrix: list(Ref::from_schema_name("Vector"), 3);
    /// Two numbers: real and imaginary part, or least and greatest.
    Pair: list(any_number(), 2);
    /// Least and greatest of something that is not below zero.
    Span: list(number(0.0..=1e9), 2);
    /// Directions of the arms on the base, degrees.
    ArmAngles: list(number(-3600.0..=3600.0), 3);
    /// The signs `K_j` of the three arms, each 1 or -1.
    Branch: list(
        ObjectBuilder::new().schema_type(Type::Integer).enum_values(Some([1, -1])),
        3,
    );
    /// Cells along x, y and z; at most 100,000 in all.
    Cells: list(
        ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(1)).maximum(Some(100_000)),
        3,
    );
    /// A handle position in m.
    Place: number(-10.0..=10.0);
    /// Length of an edge of a block, or of a step in it, m.
    BlockEdge: number(EDGE_M);
    /// Where something on a block is along one axis, m.
    BlockPlace: number(PLACE_M);
    /// A damping in N·s/m.
    Damping: number(0.0..=1e6);
    /// A frequency in rad/s.
    Frequency: number(1e-100..=1e100);
}
