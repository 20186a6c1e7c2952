//! RIHS01: the hash of a type, by which two ends of a topic know that they mean the same. It is SHA-256 of a
//! description of the type and of every type in it, as JSON in one fixed spelling: defaults, constants and comments do
//! not count.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt::Write as _;

use sha2::{Digest as _, Sha256};

use crate::interface::{Count, Field, Kind, fields, nested_in};

/// The hash of a message, of a service or of a part of a service, such as `RIHS01_` and 64 hexadecimal digits. None
/// where there is no such type.
#[must_use]
pub fn type_hash(name: &str) -> Option<String> {
    let mut hash = "RIHS01_".to_owned();
    for byte in Sha256::digest(description(name)?) {
        write!(hash, "{byte:02x}").expect("a string takes everything");
    }
    Some(hash)
}

/// What is hashed.
fn description(name: &str) -> Option<String> {
    let own = fields(name)?;
    // Sorted by name, which is the order in which they count.
    let mut referenced: BTreeMap<String, Vec<Field>> = BTreeMap::new();
    let mut next: Vec<String> = nested_in(&own).collect();
    while let Some(name) = next.pop() {
        if let Entry::Vacant(entry) = referenced.entry(name) {
            let fields = fields(entry.key())?;
            next.extend(nested_in(&fields));
            entry.insert(fields);
        }
    }
    let referenced = referenced.iter();
    let referenced: Vec<String> = referenced.map(|(name, fields)| one(name, fields)).collect();
    Some(format!(
        r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
        one(name, &own),
        referenced.join(", ")
    ))
}

fn one(name: &str, fields: &[Field]) -> String {
    let fields: Vec<String> = fields.iter().map(field).collect();
    format!(
        r#"{{"type_name": "{name}", "fields": [{}]}}"#,
        fields.join(", ")
    )
}

fn field(field: &Field) -> String {
    let (kind, nested) = match &field.kind {
        Kind::Plain(kind) => (*kind, ""),
        Kind::Nested(name) => (1, name.as_str()),
    };
    let (offset, capacity) = match field.count {
        Count::One => (0, 0),
        Count::Exactly(count) => (48, count),
        Count::AtMost(most) => (96, most),
        Count::Any => (144, 0),
    };
    format!(
        r#"{{"name": "{}", "type": {{"type_id": {}, "capacity": {capacity}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#,
        field.name,
        kind + offset,
    )
}
