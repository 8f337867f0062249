//! The vector of unknowns: per surface an albedo and an emission, the three channels apart.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Values of all unknowns. A surface is a set of triangles that fraction theirs: an object, or a single triangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unknowns {
    /// Diffuse reflectance of each surface, in [0, 1].
    pub albedo: Vec<Vec3>,
    /// Emitted radiance of each surface, ≥ 0.
    pub emission: Vec<Vec3>,
}

impl Unknowns {
    /// Grey and dark.
    pub fn new(surfaces: usize) -> Self {
        Self {
            albedo: vec![Vec3::splat(0.5); surfaces],
            emission: vec![Vec3::ZERO; surfaces],
        }
    }

    /// Number of surfaces.
    pub fn surfaces(&self) -> usize {
        self.albedo.len()
    }

    /// The value of a parameter: albedos come first, then emissions.
    pub fn value(&self, parameter: usize) -> Vec3 {
        match parameter.checked_sub(self.surfaces()) {
            None => self.albedo[parameter],
            Some(surface) => self.emission[surface],
        }
    }

    /// The same, to be changed.
    pub fn value_mut(&mut self, parameter: usize) -> &mut Vec3 {
        match parameter.checked_sub(self.surfaces()) {
            None => &mut self.albedo[parameter],
            Some(surface) => &mut self.emission[surface],
        }
    }
}
