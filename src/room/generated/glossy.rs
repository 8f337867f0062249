//! Rooms with glossy objects.

use crate::room::generated::furnisher::Furnisher;
use crate::transport::material::{DIELECTRIC, Lobe};
use glam::Vec3;

/// Range of the GGX roughness α.
const ROUGHNESS: [f64; 2] = [0.1, 0.5];
/// Largest specular reflectance at normal incidence, as of coatings and stones.
const MAX_SPECULAR: f64 = 0.2;
/// Fraction of the objects that are glossy.
const FRACTION: f64 = 0.5;

/// A plain room in which the floor and about half of the other objects, but no lamps, have a specular lobe over their diffuse
/// base. Half of the lobes have the reflectance of common dielectrics, the others a larger one.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    for object in 0..f.materials.len() {
        let [chosen, strong] = [(); 2].map(|()| f.between(0.0, 1.0));
        let roughness = f.scaled(ROUGHNESS[0], ROUGHNESS[1]) as f32;
        let specular = f.scaled(f64::from(DIELECTRIC), MAX_SPECULAR) as f32;
        let is_lamp = f.materials[object].emission != Vec3::ZERO;
        // Object 0 is the floor, which is always glossy.
        if is_lamp || object > 0 && chosen > FRACTION {
            continue;
        }
        let specular = if strong < 0.5 { DIELECTRIC } else { specular };
        f.materials[object].lobe = Some(Lobe {
            roughness,
            specular: Vec3::splat(specular),
        });
    }
    f.look_around(6, 12);
    f.expose(16.0, 64.0);
}
