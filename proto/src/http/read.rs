//! Reads types from a JSON document by the rules of the interface, and says in the words of the interface what is
//! wrong.
//!
//! Serde alone is both stricter and laxer than a JSON schema: it refuses `1.0` where a whole number is wanted, and
//! takes an array for an object, and an object of one field for a word. Its errors name types of this program, which
//! nobody outside knows.

use std::borrow::Cow;
use std::fmt;

use serde::de::value::StrDeserializer;
use serde::de::{
    self, DeserializeSeed, Deserializer, Expected, MapAccess, SeqAccess, Unexpected, Visitor,
};
use serde::forward_to_deserialize_any;
use serde_json::{Map, Number, Value};

use super::readable;
use crate::validate::FieldError;

/// Reads a document in which no object has two fields of one name: a [`Value`] keeps the last of them in silence. Where
/// it is none, the text has the place of the mistake as a JSON pointer, which serde does not tell.
pub(super) struct Document<'p>(pub(super) &'p mut String);

impl<'de> DeserializeSeed<'de> for Document<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Document<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Value, A::Error> {
        let Self(place) = self;
        let mut items = Vec::new();
        loop {
            let item = seq.next_element_seed(Document(place));
            let number = items.len();
            match item.inspect_err(|_| place.insert_str(0, &format!("/{number}")))? {
                Some(item) => items.push(item),
                None => return Ok(Value::Array(items)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let Self(place) = self;
        let mut fields = Map::new();
        while let Some(name) = map.next_key::<String>()? {
            if fields.contains_key(&name) {
                return Err(de::Error::custom(format!("duplicate field `{name}`")));
            }
            let value = map.next_value_seed(Document(place));
            let value = value.inspect_err(|_| place.insert_str(0, &segment(&name)))?;
            fields.insert(name, value);
        }
        Ok(Value::Object(fields))
    }
}

/// One key of a JSON pointer, RFC 6901.
pub(super) fn segment(key: &str) -> String {
    format!("/{}", key.replace('~', "~0").replace('/', "~1"))
}

/// Reads one value of a document.
///
/// A number without a fraction is a whole number however it is written: 1, 1.0 or 1e0. A word is a text, an object is
/// an object and an array has as many items as are wanted.
#[derive(Clone, Copy)]
pub(super) struct Reader<'de>(pub(super) &'de Value);

/// What is wrong with a value, and where in what was read. A tagged enumeration is no level of the document.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.detail)]
pub(super) struct ReadError(pub(super) FieldError);

impl ReadError {
    fn new(detail: String) -> Self {
        Self(FieldError::new("", detail))
    }

    fn under(self, prefix: &str) -> Self {
        Self(self.0.under(prefix))
    }
}

/// The fields of an object, in their order.
struct Fields<'de> {
    rest: serde_json::map::Iter<'de>,
    read: Option<(&'de String, &'de Value)>,
}

impl<'de> MapAccess<'de> for Fields<'de> {
    type Error = ReadError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, ReadError> {
        self.read = self.rest.next();
        self.read.map_or(Ok(None), |(name, _)| {
            let key = seed.deserialize(StrDeserializer::new(name));
            key.map(Some)
                .map_err(|error: ReadError| error.under(&segment(name)))
        })
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, ReadError> {
        let (name, value) = self
            .read
            .take()
            .ok_or_else(|| ReadError::new("a value was read before its name".to_owned()))?;
        let value = seed.deserialize(Reader(value));
        value.map_err(|error: ReadError| error.under(&segment(name)))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.rest.len())
    }
}

/// The items of an array, in their order.
struct Items<'de>(std::iter::Enumerate<std::slice::Iter<'de, Value>>);

impl<'de> SeqAccess<'de> for Items<'de> {
    type Error = ReadError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, ReadError> {
        self.0.next().map_or(Ok(None), |(index, item)| {
            let value = seed.deserialize(Reader(item));
            value
                .map(Some)
                .map_err(|error: ReadError| error.under(&format!("/{index}")))
        })
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

impl<'de> Reader<'de> {
    fn refused<V: Visitor<'de>>(self, wanted: &V) -> ReadError {
        de::Error::invalid_type(unexpected(self.0), wanted)
    }

    fn whole<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        match self.0.as_f64() {
            // -0.0 is 0 to whoever counts.
            Some(zero) if zero.abs() <= 0.0 => visitor.visit_u64(0),
            Some(large) if EXACT < large.abs() && !self.0.is_u64() && !self.0.is_i64() => {
                let large = readable(large);
                Err(ReadError::new(format!(
                    "{large} is larger than any whole number here may be"
                )))
            }
            _ => self.deserialize_any(visitor),
        }
    }
}

macro_rules! whole_numbers {
    ($($method:ident)+) => {
        $(
            fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
                self.whole(visitor)
            }
        )+
    };
}

impl<'de> Deserializer<'de> for Reader<'de> {
    type Error = ReadError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        match self.0 {
            Value::Null => visitor.visit_unit(),
            Value::Bool(value) => visitor.visit_bool(*value),
            Value::Number(number) => match simplest(number) {
                Simplest::Unsigned(value) => visitor.visit_u64(value),
                Simplest::Signed(value) => visitor.visit_i64(value),
                Simplest::Float(value) => visitor.visit_f64(value),
            },
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Array(items) => visitor.visit_seq(Items(items.iter().enumerate())),
            Value::Object(fields) => visitor.visit_map(Fields {
                rest: fields.iter(),
                read: None,
            }),
        }
    }

    whole_numbers! {
        deserialize_i8 deserialize_i16 deserialize_i32 deserialize_i64
        deserialize_u8 deserialize_u16 deserialize_u32 deserialize_u64
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        match self.0 {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        match self.0 {
            Value::Array(items) if items.len() != length => {
                Err(de::Error::invalid_length(items.len(), &visitor))
            }
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        match self.0 {
            Value::Object(_) => self.deserialize_any(visitor),
            _ => Err(self.refused(&visitor)),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        match self.0 {
            Value::String(word) => visitor.visit_enum(StrDeserializer::new(word)),
            other => Err(de::Error::invalid_type(unexpected(other), &"a word")),
        }
    }

    forward_to_deserialize_any! {
        bool i128 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple_struct map identifier
        ignored_any
    }
}

impl de::Error for ReadError {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self::new(message.to_string())
    }

    fn invalid_type(came: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        let came: Cow<'_, str> = match came {
            Unexpected::Bool(_) => "a truth value".into(),
            Unexpected::Unsigned(value) => value.to_string().into(),
            Unexpected::Signed(value) => value.to_string().into(),
            Unexpected::Float(value) => readable(value).into(),
            Unexpected::Str(_) | Unexpected::Char(_) => "a text".into(),
            Unexpected::Unit | Unexpected::Option => "null".into(),
            Unexpected::Seq => "an array".into(),
            Unexpected::Map => "an object".into(),
            _ => "something else".into(),
        };
        Self::new(format!("{came} came, wanted {}", in_words(wanted)))
    }

    fn invalid_value(came: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::invalid_type(came, wanted)
    }

    fn invalid_length(length: usize, wanted: &dyn Expected) -> Self {
        Self::new(format!(
            "an array of {length} came, wanted {}",
            in_words(wanted)
        ))
    }

    fn unknown_variant(word: &str, wanted: &'static [&'static str]) -> Self {
        Self::new(format!("`{word}` came, wanted one of {wanted:?}"))
    }
}

/// A number in the simplest form that holds its value.
enum Simplest {
    Unsigned(u64),
    Signed(i64),
    Float(f64),
}

/// Up to here every whole number has a float of its own, so that going from one to the other loses nothing.
const EXACT: f64 = 9_007_199_254_740_992.0;

fn simplest(number: &Number) -> Simplest {
    if let Some(value) = number.as_u64() {
        return Simplest::Unsigned(value);
    }
    if let Some(value) = number.as_i64() {
        return Simplest::Signed(value);
    }
    let value = number.as_f64().unwrap_or(f64::NAN);
    let is_whole = value.fract().abs() <= 0.0 && value.abs() <= EXACT;
    // The sign of -0.0 would be lost.
    if is_whole && 0.0 < value {
        Simplest::Unsigned(value as u64)
    } else if is_whole && value < 0.0 {
        Simplest::Signed(value as i64)
    } else {
        Simplest::Float(value)
    }
}

fn unexpected(value: &Value) -> Unexpected<'_> {
    match value {
        Value::Null => Unexpected::Unit,
        Value::Bool(value) => Unexpected::Bool(*value),
        Value::Number(number) => match simplest(number) {
            Simplest::Unsigned(value) => Unexpected::Unsigned(value),
            Simplest::Signed(value) => Unexpected::Signed(value),
            Simplest::Float(value) => Unexpected::Float(value),
        },
        Value::String(text) => Unexpected::Str(text),
        Value::Array(_) => Unexpected::Seq,
        Value::Object(_) => Unexpected::Map,
    }
}

/// What serde says that it expects, with the interface's word in place of a type's name.
fn in_words(wanted: &dyn Expected) -> String {
    let wanted = wanted.to_string();
    let words = match &*wanted {
        "u8" => return format!("a whole number from 0 to {}", u8::MAX),
        "u16" => return format!("a whole number from 0 to {}", u16::MAX),
        "u32" => return format!("a whole number from 0 to {}", u32::MAX),
        "u64" => "a whole number, 0 or above",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a string" => "a text",
        "a sequence" => "an array",
        "a map" => "an object",
        other if other.starts_with("struct ") => "an object",
        other => match other.strip_prefix("an array of length ") {
            Some(length) => return format!("an array of {length}"),
            None => return wanted,
        },
    };
    words.to_owned()
}
