//! Known values of a scene, which are held fixed while the rest is solved.

use glam::Vec3;
use std::collections::BTreeMap;

/// The known values of one object.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pinned {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub albedo: Option<Vec3>,
    /// Emitted radiance, W·sr⁻¹·m⁻².
    pub emission: Option<Vec3>,
}

impl Pinned {
    /// Which values are held, in words; empty if none is.
    pub fn words(&self) -> &'static str {
        match (self.albedo.is_some(), self.emission.is_some()) {
            (true, true) => "albedo and emission held at known values",
            (true, false) => "albedo held at a known value",
            (false, true) => "emission held at a known value",
            (false, false) => "",
        }
    }
}

/// The known values of all objects, by object index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Known(BTreeMap<usize, Pinned>);

impl Known {
    /// The known values of an object.
    pub fn object(&self, object: usize) -> Pinned {
        self.0.get(&object).copied().unwrap_or_default()
    }

    /// Replaces the known values of an object. Impossible values are clamped.
    pub fn set(&mut self, object: usize, pinned: Pinned) {
        let pinned = Pinned {
            albedo: pinned.albedo.map(|a| a.clamp(Vec3::ZERO, Vec3::ONE)),
            emission: pinned.emission.map(|e| e.max(Vec3::ZERO)),
        };
        if pinned == Pinned::default() {
            self.0.remove(&object);
        } else {
            self.0.insert(object, pinned);
        }
    }

    /// All objects with known values, in ascending order.
    pub fn objects(&self) -> impl Iterator<Item = (usize, Pinned)> + '_ {
        self.0.iter().map(|(&object, &pinned)| (object, pinned))
    }

    /// Whether no value is known.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
