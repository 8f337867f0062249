//! Seats and cushions.

use crate::room::furniture::{legs, pad};
use crate::room::shape::Modeller;
use glam::{DAffine3, DVec3};

/// A seat without its feet, `width` × `depth` metres, with `cushions` side by side.
pub fn upholstery(m: &mut Modeller, width: f64, depth: f64, cushions: u32) {
    let arm = 0.17;
    let half = width * 0.5;
    let inner = width - 2.0 * arm;
    let back = -depth * 0.5;
    pad(m, [-half, 0.12, back], [width, 0.16, depth], 0.03);
    pad(m, [-half, 0.27, back], [width, 0.50, 0.20], 0.06);
    for x in [-half, half - arm] {
        let low = [x, 0.27, back + 0.10];
        pad(m, low, [arm, 0.30, depth - 0.10], 0.04);
    }
    let each = inner / f64::from(cushions);
    for i in 0..cushions {
        let x = -inner * 0.5 + each * f64::from(i);
        let low = [x + 0.004, 0.285, back + 0.19];
        pad(m, low, [each - 0.008, 0.15, depth - 0.17], 0.045);
        let middle = DVec3::new(x + each * 0.5, 0.62, back + 0.27);
        let tilt = DAffine3::from_translation(middle) * DAffine3::from_rotation_x(-0.16);
        let half = DVec3::new(each * 0.5 - 0.006, 0.21, 0.075);
        m.placed(tilt, |m| m.rounded_box(DVec3::ZERO, half, 0.06, 1));
    }
}

/// Four tapered feet below [`upholstery`].
pub fn feet(m: &mut Modeller, width: f64, depth: f64) {
    let half = [width * 0.5 - 0.10, depth * 0.5 - 0.09];
    legs(m, half, 0.125, [0.02; 2], [0.014, 0.024]);
}

/// A square cushion, centred at the origin.
pub fn cushion(m: &mut Modeller, size: f64) {
    // Two domes over a square with pinched corners.
    let steps = 6;
    let dome = |side: f64| -> Vec<Vec<DVec3>> {
        let line = |i: u32| 2.0 * f64::from(i) / f64::from(steps) - 1.0;
        let rows = (0..=steps).map(|j| {
            let row = (0..=steps).map(|i| {
                let (x, y) = (side * line(i), line(j));
                let pinch = 1.0 - 0.10 * (x * y).abs() - 0.07 * (1.0 - (x * x).max(y * y));
                let bulge = ((1.0 - x.powi(4)) * (1.0 - y.powi(4))).sqrt() * 0.17;
                DVec3::new(x * pinch, y * pinch, side * bulge) * (size * 0.5)
            });
            row.collect()
        });
        rows.collect()
    };
    m.surface(&dome(1.0), false);
    m.surface(&dome(-1.0), false);
}

/// A round stool on three splayed legs.
pub fn stool(m: &mut Modeller) {
    let seat = [
        [0.16, 0.42],
        [0.175, 0.43],
        [0.18, 0.445],
        [0.175, 0.46],
        [0.15, 0.466],
    ];
    m.lathe(&seat, 20);
    for i in 0..3 {
        let turn = f64::from(i).mul_add(2.094, 0.5);
        let direction = DVec3::new(turn.cos(), 0.0, turn.sin());
        let top = direction * 0.11 + DVec3::Y * 0.425;
        m.bar(direction * 0.19, top, [0.013, 0.019], 8);
    }
}
