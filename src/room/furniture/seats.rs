//! Seats and cushions.

use crate::room::furniture::pad;
use crate::room::shape::Modeller;
use glam::{DAffine3, DVec3};

/// A seat without its feet, `width` × `depth` metres, with `cushions` side by side.
pub fn upholstery(m: &mut Modeller, width: f64, depth: f64, cushions: u32) {
    let arm = 0.17;
    let half = width * 0.5;
    let inner = width - 2.0 * arm;
    pad(m, [-half, 0.12, -depth * 0.5], [width, 0.16, depth], 0.03);
    pad(m, [-half, 0.27, -depth * 0.5], [width, 0.50, 0.20], 0.06);
    for x in [-half, half - arm] {
        pad(
            m,
            [x, 0.27, -depth * 0.5 + 0.10],
            [arm, 0.30, depth - 0.10],
            0.04,
        );
    }
    let each = inner / f64::from(cushions);
    for i in 0..cushions {
        let x = -inner * 0.5 + each * f64::from(i);
        pad(
            m,
            [x + 0.004, 0.285, -depth * 0.5 + 0.19],
            [each - 0.008, 0.15, depth - 0.17],
            0.045,
        );
        let tilt =
            DAffine3::from_translation(DVec3::new(x + each * 0.5, 0.62, -depth * 0.5 + 0.27))
                * DAffine3::from_rotation_x(-0.16);
        m.placed(tilt, |m| {
            m.rounded_box(
                DVec3::ZERO,
                DVec3::new(each * 0.5 - 0.006, 0.21, 0.075),
                0.06,
                1,
            );
        });
    }
}

/// Four tapered feet below [`upholstery`].
pub fn feet(m: &mut Modeller, width: f64, depth: f64) {
    for x in [-1.0, 1.0] {
        for z in [-1.0, 1.0] {
            let top = DVec3::new(x * (width * 0.5 - 0.10), 0.125, z * (depth * 0.5 - 0.09));
            let foot = DVec3::new(top.x + 0.02 * x, 0.0, top.z + 0.02 * z);
            m.bar(foot, top, [0.014, 0.024], 8);
        }
    }
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
    m.lathe(
        &[
            [0.16, 0.42],
            [0.175, 0.43],
            [0.18, 0.445],
            [0.175, 0.46],
            [0.15, 0.466],
        ],
        20,
    );
    for i in 0..3 {
        let turn = f64::from(i).mul_add(2.094, 0.5);
        let direction = DVec3::new(turn.cos(), 0.0, turn.sin());
        let top = direction * 0.11 + DVec3::Y * 0.425;
        m.bar(direction * 0.19, top, [0.013, 0.019], 8);
    }
}
