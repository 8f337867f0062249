//! Furniture in local coordinates: standing on y = 0, facing +z, in metres.

pub mod seats;
pub mod vessels;
pub mod woodwork;

use crate::room::shape::Modeller;
use glam::DVec3;

/// Four round legs from the corners of a rectangle of half sizes `half` at the height `top`. Their feet stand out by `splay` along
/// x and z; `radii` are those of foot and top.
fn legs(m: &mut Modeller, half: [f64; 2], top: f64, splay: [f64; 2], radii: [f64; 2]) {
    for x in [-1.0, 1.0] {
        for z in [-1.0, 1.0] {
            let top = DVec3::new(x * half[0], top, z * half[1]);
            let foot = DVec3::new(top.x + splay[0] * x, 0.0, top.z + splay[1] * z);
            m.bar(foot, top, radii, 8);
        }
    }
}

/// A rounded box given by its low corner and size.
fn pad(m: &mut Modeller, low: [f64; 3], size: [f64; 3], radius: f64) {
    let half = DVec3::from(size) * 0.5;
    m.rounded_box(DVec3::from(low) + half, half, radius, 1);
}
