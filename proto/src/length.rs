//! Lengths that two machines must agree on to the last bit.

use std::ops::RangeInclusive;

use serde::de::Error;
use serde::{Deserialize, Deserializer};

use crate::http::check;

/// The length, m, to the nearest nanometre.
///
/// Clay is the same on both sides only if tool, block and voxels are. A decimal number of up to 15 digits is read back
/// from JSON exactly as it was, one of 16 or 17 need not be; a nanometre is below what a sweep's position resolves, and a
/// whole number of them keeps within 15 digits up to a thousand kilometres.
pub(crate) fn to_nanometres(length_m: f64) -> f64 {
    (length_m * 1e9).round() / 1e9
}

/// Reads a length within `range_m`, to the nearest nanometre. The range comes first: rounding would pull into it what
/// lies just outside.
pub(crate) fn within<'de, D: Deserializer<'de>>(
    deserializer: D,
    range_m: RangeInclusive<f64>,
) -> Result<f64, D::Error> {
    let length_m = f64::deserialize(deserializer)?;
    check("", length_m, range_m).map_err(|error| D::Error::custom(error.detail))?;
    Ok(to_nanometres(length_m))
}
