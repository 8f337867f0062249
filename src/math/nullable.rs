//! Numbers in JSON, which knows no infinity: what is no finite number is `null`.

use glam::Vec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A linear colour; a channel that is no finite number is `null`.
pub type Rgb = [Option<f32>; 3];

/// A colour for a file.
pub fn rgb(color: Vec3) -> Rgb {
    color.to_array().map(finite)
}

/// A number for a file.
pub fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

/// `serialize_with` of a colour.
///
/// # Errors
/// The writer fails.
pub fn color<S: Serializer>(color: &Vec3, serializer: S) -> Result<S::Ok, S::Error> {
    rgb(*color).serialize(serializer)
}

/// `serialize_with` of a number that may be missing.
///
/// # Errors
/// The writer fails.
pub fn number<S: Serializer>(value: &Option<f32>, serializer: S) -> Result<S::Ok, S::Error> {
    value.and_then(finite).serialize(serializer)
}

/// `deserialize_with` of a colour whose unknown channels are 0.
///
/// # Errors
/// There is no colour.
pub fn or_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Ok(Rgb::deserialize(deserializer)?
        .map(|v| v.unwrap_or(0.0))
        .into())
}

/// `deserialize_with` of a standard error, infinite where nothing is known.
///
/// # Errors
/// There is no colour.
pub fn or_infinity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Ok(Rgb::deserialize(deserializer)?
        .map(|v| v.unwrap_or(f32::INFINITY))
        .into())
}
