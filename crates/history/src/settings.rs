//! Settings in records and snapshots.

use std::sync::Arc;

use teleclay_clay::{Operation, ToolShape};
use teleclay_session::Settings;

use crate::bytes::{Malformed, Reader};

/// The first version that knows the tool, and what it does.
pub(crate) fn version_of(settings: &Settings) -> u8 {
    match (settings.operation(), settings.tool_shape()) {
        (Operation::Add | Operation::Smooth, _) => 3,
        (Operation::Cut, ToolShape::Cylinder(_) | ToolShape::Loop(_)) => 2,
        (Operation::Cut, ToolShape::Ball(_) | ToolShape::Blade(_)) => 1,
    }
}

/// As JSON, behind its length in four bytes: so it is written in one go.
pub(crate) fn put_settings(out: &mut Vec<u8>, settings: &Settings) {
    let start = out.len();
    out.extend_from_slice(&[0; 4]);
    let written = serde_json::to_writer(&mut *out, settings);
    debug_assert!(written.is_ok(), "settings are plain data: {written:?}");
    let length = (out.len() - start - 4) as u32;
    out[start..start + 4].copy_from_slice(&length.to_le_bytes());
}

/// Settings that are proven once more: bytes prove nothing.
pub(crate) fn read_settings(reader: &mut Reader<'_>) -> Result<Arc<Settings>, Malformed> {
    let length = reader.slice(4, "settings")?;
    let length = u32::from_le_bytes(std::array::from_fn(|at| length[at]));
    let text = reader.slice(length as usize, "settings")?;
    let wrong = |why: String| Malformed::Text {
        what: "settings",
        why,
    };
    let settings: Settings =
        serde_json::from_slice(text).map_err(|error| wrong(error.to_string()))?;
    Settings::new(settings.spec.clone()).map_err(|error| wrong(error.detail))?;
    Ok(Arc::new(settings))
}
