//! The unknowns of a solve: RGB albedo and RGB emission of each surface.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Values of all unknowns. A surface is a set of triangles with common unknowns: an object, or an outside direction.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Unknowns {
    /// Diffuse reflectance of each surface, in [0, 1].
    pub albedo: Vec<Vec3>,
    /// Emitted radiance of each surface, ≥ 0.
    pub emission: Vec<Vec3>,
}

impl Unknowns {
    /// Albedos of 0.5, and no emission.
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

    /// The upper bound of a parameter: 1 for albedos. The lower bound is zero.
    pub fn upper(&self, parameter: usize) -> f64 {
        match parameter < self.surfaces() {
            true => 1.0,
            false => f64::INFINITY,
        }
    }

    /// Whether a channel of a parameter is at a bound and the direction of descent points out of it.
    pub fn is_held(&self, parameter: usize, channel: usize, descent: f64) -> bool {
        let value = f64::from(self.value(parameter)[channel]);
        let upper = self.upper(parameter);
        (value <= 0.0 && descent < 0.0) || (value >= upper && descent > 0.0)
    }

    /// Mutable access to the value of a parameter.
    pub fn value_mut(&mut self, parameter: usize) -> &mut Vec3 {
        match parameter.checked_sub(self.surfaces()) {
            None => &mut self.albedo[parameter],
            Some(surface) => &mut self.emission[surface],
        }
    }
}

#[cfg(test)]
impl Unknowns {
    /// Grey albedos and emissions, for tests.
    pub fn grey<const N: usize>(albedo: [f32; N], emission: [f32; N]) -> Self {
        Self {
            albedo: albedo.map(Vec3::splat).to_vec(),
            emission: emission.map(Vec3::splat).to_vec(),
        }
    }
}
