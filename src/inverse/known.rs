//! What is known of a scene beforehand: values that are held while the rest is solved.

use glam::Vec3;
use std::collections::BTreeMap;

/// What is known of one object.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pinned {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub albedo: Option<Vec3>,
    /// Emitted radiance, W·sr⁻¹·m⁻².
    pub emission: Option<Vec3>,
}

impl Pinned {
    /// What is held, in a few words; empty where nothing is.
    pub fn words(&self) -> &'static str {
        match (self.albedo.is_some(), self.emission.is_some()) {
            (true, true) => "albedo and emission held at known values",
            (true, false) => "albedo held at a known value",
            (false, true) => "emission held at a known value",
            (false, false) => "",
        }
    }
}

/// What is known of all objects, by their index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Known(BTreeMap<usize, Pinned>);

impl Known {
    /// What is known of an object.
    pub fn of(&self, object: usize) -> Pinned {
        self.0.get(&object).copied().unwrap_or_default()
    }

    /// Replaces what is known of an object. Values that no surface has are brought into range.
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

    /// All objects of which something is known, ascending.
    pub fn objects(&self) -> impl Iterator<Item = (usize, Pinned)> + '_ {
        self.0.iter().map(|(&object, &pinned)| (object, pinned))
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
