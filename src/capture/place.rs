//! Places a capture: scale to metres, and ground at height 0.

use crate::capture::Capture;
use crate::error::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The map from the coordinates of a capture's files to scene units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Coordinates {
    /// Metres per file unit; `None` means 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Height of the ground in file units, along the unit up vector; the map takes it to 0. `None` means 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<f64>,
}

impl Coordinates {
    /// Maps a point of the files; `up` is the unit up vector.
    pub fn apply(&self, point: DVec3, up: DVec3) -> DVec3 {
        (point - up * self.ground.unwrap_or(0.0)) * self.scale.unwrap_or(1.0)
    }

    /// The inverse of [`Coordinates::apply`].
    pub fn undo(&self, point: DVec3, up: DVec3) -> DVec3 {
        point / self.scale.unwrap_or(1.0) + up * self.ground.unwrap_or(0.0)
    }
}

impl Capture {
    /// The capture with another up vector, if one is given, and in other coordinates.
    ///
    /// # Errors
    /// The scale is not positive, or a number is not finite.
    pub fn placed(mut self, up: Option<DVec3>, coordinates: &Coordinates) -> Result<Self> {
        let scale = coordinates.scale.unwrap_or(1.0);
        let usable = scale.is_finite() && scale > 0.0;
        if !usable || !coordinates.ground.is_none_or(f64::is_finite) {
            return Err(Error::usage(
                "--scale",
                "is not a valid scale",
                "give metres per unit, above 0",
            ));
        }
        if let Some(up) = up.and_then(DVec3::try_normalize) {
            self.up = up;
        }
        if *coordinates == Coordinates::default() {
            return Ok(self);
        }
        for position in &mut self.mesh.positions {
            *position = coordinates.apply(*position, self.up);
        }
        for frame in &mut self.frames {
            frame.pose.center = coordinates.apply(frame.pose.center, self.up);
            if let Some((_, metres)) = &mut frame.depth {
                *metres *= scale;
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_go_there_and_back_and_the_ground_is_at_zero() {
        let coordinates = Coordinates {
            scale: Some(0.3048),
            ground: Some(-4.0),
        };
        let up = DVec3::new(0.0, 0.6, 0.8);
        let point = DVec3::new(3.0, -1.0, 7.0);
        let there = coordinates.apply(point, up);
        assert!((coordinates.undo(there, up) - point).length() < 1e-12);
        let on_ground = up * -4.0 + up.any_orthonormal_vector() * 5.0;
        assert!(coordinates.apply(on_ground, up).dot(up).abs() < 1e-12);
        let apart = (there - coordinates.apply(DVec3::ZERO, up)).length();
        assert!((apart - 0.3048 * point.length()).abs() < 1e-12);
    }
}
