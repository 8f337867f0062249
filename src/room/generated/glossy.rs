//! Rooms with glossy things in them.

use crate::room::generated::furnisher::Furnisher;
use crate::transport::material::{DIELECTRIC, Lobe};
use glam::Vec3;

/// Roughness of the lobes, α of GGX.
const ROUGHNESS: [f64; 2] = [0.1, 0.5];
/// Greatest specular reflectance at normal incidence of coatings and stones.
const MAX_SPECULAR: f64 = 0.2;
/// Fraction of the surfaces that are glossy.
const FRACTION: f64 = 0.5;

/// A plain room in which the floor and about half of the rest, lamps left out, have a lobe over their diffuse base. Half of the
/// lobes are those of common dielectrics, the others stronger.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    for object in 0..f.materials.len() {
        let [chosen, strong] = [(); 2].map(|()| f.between(0.0, 1.0));
        let roughness = f.scaled(ROUGHNESS[0], ROUGHNESS[1]) as f32;
        let specular = f.scaled(f64::from(DIELECTRIC), MAX_SPECULAR) as f32;
        let is_lamp = f.materials[object].emission != Vec3::ZERO;
        // The floor is the first.
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
