//! The sun: a far source of light too small for the pixels of a map.

use crate::math::frame::Frame;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

/// Angular radius of the sun's disc in radians.
pub const RADIUS: f32 = 4.65e-3;

/// A disc of even radiance, infinitely far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sun {
    /// Unit direction towards it, in scene coordinates.
    pub direction: Vec3,
    /// Irradiance at normal incidence.
    pub irradiance: Vec3,
}

impl Sun {
    /// Solid angle of the disc in steradians.
    pub const SOLID_ANGLE: f32 = PI * RADIUS * RADIUS;

    /// Radiance from a unit direction; black beside the disc.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match self.covers(direction) {
            true => self.irradiance / Self::SOLID_ANGLE,
            false => Vec3::ZERO,
        }
    }

    /// Pdf per solid angle of [`sample`].
    pub fn pdf(&self, direction: Vec3) -> f32 {
        match self.covers(direction) {
            true => 1.0 / Self::SOLID_ANGLE,
            false => 0.0,
        }
    }

    fn covers(&self, direction: Vec3) -> bool {
        // The chord of an angle, which keeps more digits than its cosine.
        direction.distance_squared(self.direction) <= RADIUS * RADIUS
    }
}

/// A unit direction drawn evenly from the disc of a sun that stands in the direction `towards`.
pub fn sample(towards: Vec3, u: [f32; 2]) -> Vec3 {
    let (radius, angle) = (RADIUS * u[0].sqrt(), 2.0 * PI * u[1]);
    let beside = Vec3::new(radius * angle.cos(), radius * angle.sin(), 1.0);
    Frame::around(towards).to_world(beside).normalize()
}
