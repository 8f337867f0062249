//! JSON of numbers that may not be finite: `serde_json` writes those as `null`.

use glam::Vec3;
use serde::{Deserialize, Deserializer};

/// A linear colour; non-finite channels are `None`.
pub type Rgb = [Option<f32>; 3];

/// A colour for serialization.
pub fn rgb(color: Vec3) -> Rgb {
    color.to_array().map(|v| v.is_finite().then_some(v))
}

/// `deserialize_with` for a colour; `null` channels are 0.
///
/// # Errors
/// The value is no colour.
pub fn or_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Rgb::deserialize(deserializer).map(|color| color.map(|v| v.unwrap_or(0.0)).into())
}

/// `deserialize_with` for a standard error; `null` channels are infinite.
///
/// # Errors
/// The value is no colour.
pub fn or_infinity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    Rgb::deserialize(deserializer).map(or_infinite)
}

/// `deserialize_with` for standard errors; `null` channels are infinite.
///
/// # Errors
/// The value is no list of colours.
pub fn all_or_infinity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Vec3>, D::Error> {
    let colors = Vec::<Rgb>::deserialize(deserializer)?;
    Ok(colors.into_iter().map(or_infinite).collect())
}

fn or_infinite(color: Rgb) -> Vec3 {
    color.map(|v| v.unwrap_or(f32::INFINITY)).into()
}
