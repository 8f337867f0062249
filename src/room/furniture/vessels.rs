//! Surfaces of revolution (vessels, lamps), and a plant.

use crate::room::shape::{Modeller, ring};
use crate::room::texture::hash;
use glam::DVec3;

/// A bulbous vase with an opening.
pub fn vase(m: &mut Modeller, height: f64) {
    const OUTLINE: [[f64; 2]; 14] = [
        [0.14, 0.00],
        [0.20, 0.03],
        [0.27, 0.15],
        [0.30, 0.30],
        [0.28, 0.45],
        [0.20, 0.60],
        [0.11, 0.74],
        [0.09, 0.84],
        [0.11, 0.94],
        [0.15, 1.00],
        [0.13, 1.00],
        [0.08, 0.88],
        [0.08, 0.74],
        [0.16, 0.55],
    ];
    m.lathe(&OUTLINE.map(|[r, y]| [r * height, y * height]), 16);
}

pub fn bowl(m: &mut Modeller, radius: f64) {
    const OUTLINE: [[f64; 2]; 9] = [
        [0.35, 0.00],
        [0.45, 0.02],
        [0.75, 0.16],
        [0.93, 0.34],
        [1.00, 0.52],
        [0.95, 0.52],
        [0.86, 0.34],
        [0.66, 0.18],
        [0.30, 0.09],
    ];
    m.lathe(&OUTLINE.map(|[r, y]| [r * radius, y * radius]), 20);
}

/// A conical pot, filled to a little below its rim.
pub fn pot(m: &mut Modeller, radius: f64, height: f64) {
    let outline = [
        [radius * 0.70, 0.0],
        [radius * 0.97, height * 0.86],
        [radius, height],
        [radius * 0.90, height],
        [radius * 0.86, height * 0.88],
    ];
    m.lathe(&outline, 20);
}

/// Arching leaves from the origin, up to about `height`.
pub fn leaves(m: &mut Modeller, count: u32, height: f64) {
    const STATIONS: u32 = 6;
    for leaf in 0..count {
        let vary = |k: u32| f64::from(hash(leaf, k));
        let azimuth = f64::from(leaf) * 2.399_963 + 0.5 * vary(1);
        let outward = DVec3::new(azimuth.cos(), 0.0, azimuth.sin());
        let side = outward.cross(DVec3::Y);
        let (reach, rise) = (0.22 + 0.24 * vary(2), height * (0.55 + 0.45 * vary(3)));
        let rings: Vec<Vec<DVec3>> = (0..=STATIONS)
            .map(|i| {
                let t = f64::from(i) / f64::from(STATIONS);
                // First upwards, then outwards and down.
                let center =
                    outward * (0.03 + reach * t * t) + DVec3::Y * (rise * t * (1.45 - 0.6 * t));
                let width = 0.004 + 0.05 * (std::f64::consts::PI * t.powf(0.8)).sin().max(0.0);
                let along = outward * (2.0 * reach * t) + DVec3::Y * (rise * (1.45 - 1.2 * t));
                let face = side.cross(along).normalize_or_zero();
                ring(center, side * width, face * -0.003, 4)
            })
            .collect();
        m.loft(&rings);
    }
}

/// Foot and pole of a floor lamp, and the cap above its lantern at height `lantern`.
pub fn lamp_stand(m: &mut Modeller, lantern: f64) {
    let foot = [[0.15, 0.0], [0.15, 0.015], [0.02, 0.03], [0.011, 0.05]];
    m.lathe(&[&foot[..], &[[0.011, lantern - 0.21]]].concat(), 16);
    let top = lantern + 0.21;
    let cap = [[0.075, top - 0.025], [0.075, top], [0.02, top + 0.02]];
    m.lathe(&cap, 16);
}

/// A slightly flattened round lantern at height `lantern`.
pub fn lantern(m: &mut Modeller, lantern: f64) {
    let outline: Vec<[f64; 2]> = (0..=10)
        .map(|i| {
            let angle = (f64::from(i) / 10.0 - 0.5) * 2.5;
            [0.19 * angle.cos(), lantern + 0.21 * angle.sin()]
        })
        .collect();
    m.lathe(&outline, 20);
}
