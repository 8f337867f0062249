//! A small chair that shadows itself.

use crate::compose::object::ObjectModel;
use crate::error::Result;
use crate::room::shape::Modeller;
use crate::transport::material::Material;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// The chair as an object of one colour, placed by `stand`; fails if a coordinate is not finite.
pub fn chair_model(name: &str, stand: DAffine3, color: Vec3) -> Result<Arc<ObjectModel>> {
    let mut modeller = Modeller::default();
    modeller.object(name);
    modeller.placed(stand, chair);
    let mesh = modeller.mesh;
    let corners = (mesh.triangles.iter())
        .map(|corners| corners.map(|i| mesh.positions[i as usize]))
        .collect();
    let material = Material::diffuse(color, Vec3::ZERO);
    ObjectModel::from_corners(name, corners, material).map(Arc::new)
}

/// A chair 0.85 m high, standing on y = 0 at the origin and facing +z: a seat on four legs, with a back of three slats.
pub fn chair(m: &mut Modeller) {
    let (half, seat, top) = (0.21, 0.44, 0.85);
    for x in [-1.0, 1.0] {
        for (z, height) in [(-1.0, top), (1.0, seat - 0.04)] {
            let foot = DVec3::new(x * (half - 0.005), 0.004, z * (half - 0.005));
            let end = DVec3::new(x * (half - 0.025), height, z * (half - 0.025));
            m.bar(foot, end, [0.015, 0.02], 8);
        }
    }
    let slab = |m: &mut Modeller, y: f64, z: f64, size: [f64; 3]| {
        let half = DVec3::from(size) * 0.5;
        m.rounded_box(DVec3::new(0.0, y, z), half, 0.012, 2);
    };
    slab(m, seat, 0.0, [2.0 * half, 0.04, 2.0 * half]);
    for i in 0..3 {
        let y = 0.57 + 0.12 * f64::from(i);
        slab(m, y, 0.025 - half, [2.0 * half - 0.05, 0.07, 0.028]);
    }
}
