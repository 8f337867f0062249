//! Furniture in local coordinates: standing on y = 0, facing +z, in metres.

pub mod seats;
pub mod vessels;
pub mod woodwork;

use crate::room::shape::Modeller;
use glam::DVec3;

/// A rounded box given by its low corner and size.
fn pad(m: &mut Modeller, low: [f64; 3], size: [f64; 3], radius: f64) {
    let half = DVec3::from(size) * 0.5;
    m.rounded_box(DVec3::from(low) + half, half, radius, 1);
}
