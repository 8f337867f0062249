//! Rooms with strong interreflection: albedos of 0.9 and more on the shell and most furniture.

use crate::room::generated::furnisher::Furnisher;
use crate::transport::material::Albedo;
use glam::Vec3;

/// Range of a white albedo in each channel. Fresh white paint reaches about 0.95.
const WHITE: [f64; 2] = [0.9, 0.96];
/// One in this many pieces of furniture is not white.
const OTHER: usize = 5;

/// A plain room, painted white.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    for shell in 0..f.materials.len() {
        paint(f, shell);
    }
    f.lamps();
    let first = f.materials.len();
    f.furniture();
    let other = f.count(1, OTHER - 1);
    for piece in first..f.materials.len() {
        if (piece - first) % OTHER != other {
            paint(f, piece);
        }
    }
    f.look_around(4, 12);
    f.expose(8.0, 32.0);
}

fn paint(f: &mut Furnisher, object: usize) {
    let channels = [(); 3].map(|()| f.between(WHITE[0], WHITE[1]) as f32);
    f.materials[object].albedo = Albedo::Constant(Vec3::from(channels));
}
