//! A moment of a recording, in numbers.

use serde_json::Value;
use teleclay_reel::{ReadError, Reel, words};

/// Bytes of a file that are read at once.
const PIECE: usize = 1 << 20;

/// What the recording tells of each of these moments, s since it began, as a page shows it.
///
/// # Errors
/// The file is no recording, or damaged.
pub fn moments(file: &[u8], at_s: &[f64]) -> Result<Vec<Value>, ReadError> {
    let mut reel = Reel::new();
    for piece in file.chunks(PIECE) {
        reel.push(piece)?;
    }
    reel.push(&[])?;
    let from_ns = reel.facts().from_ns;
    let mut found = Vec::new();
    for at_s in at_s {
        reel.seek(from_ns.saturating_add((at_s.max(0.0) * 1e9).round() as u64))?;
        while let Some(want) = reel.want() {
            let bytes = usize::try_from(want.offset)
                .ok()
                .and_then(|from| file.get(from..from.checked_add(want.length)?));
            reel.give(bytes.unwrap_or_default())?;
        }
        found.push(words::of_moment(from_ns, reel.scene()));
    }
    Ok(found)
}
