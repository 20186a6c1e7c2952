//! Lengths that two machines must agree on to the last bit.

use serde::{Deserialize, Deserializer};

/// The length, m, to the nearest nanometre.
///
/// Clay is the same on both sides only if tool, block and voxels are. A decimal number of up to 15 digits is read back
/// from JSON exactly as it was, one of 16 or 17 need not be; a nanometre is below what a sweep's position resolves, and a
/// whole number of them keeps within 15 digits up to a thousand kilometres.
pub(crate) fn to_nanometres(length_m: f64) -> f64 {
    (length_m * 1e9).round() / 1e9
}

/// Reads a length to the nearest nanometre.
pub(crate) fn nanometres<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    f64::deserialize(deserializer).map(to_nanometres)
}
