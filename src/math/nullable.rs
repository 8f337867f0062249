//! Serialization of numbers to JSON: non-finite numbers become `null`.

use glam::Vec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A linear colour; non-finite channels are `None`.
pub type Rgb = [Option<f32>; 3];

/// A colour for serialization.
pub fn rgb(color: Vec3) -> Rgb {
    color.to_array().map(finite)
}

/// A number for serialization: `None` if not finite.
pub fn finite(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

/// `serialize_with` for a colour.
///
/// # Errors
/// The writer fails.
pub fn color<S: Serializer>(color: &Vec3, serializer: S) -> Result<S::Ok, S::Error> {
    rgb(*color).serialize(serializer)
}

/// `serialize_with` for an optional number.
///
/// # Errors
/// The writer fails.
pub fn number<S: Serializer>(value: &Option<f32>, serializer: S) -> Result<S::Ok, S::Error> {
    value.and_then(finite).serialize(serializer)
}

/// `deserialize_with` for a colour; `null` channels are 0.
///
/// # Errors
/// The value is no colour.
pub fn or_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Ok(Rgb::deserialize(deserializer)?
        .map(|v| v.unwrap_or(0.0))
        .into())
}

/// `deserialize_with` for a standard error; `null` channels are infinite.
///
/// # Errors
/// The value is no colour.
pub fn or_infinity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Ok(Rgb::deserialize(deserializer)?
        .map(|v| v.unwrap_or(f32::INFINITY))
        .into())
}
