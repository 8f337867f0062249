//! Tables, cabinets, frames and the door.

use crate::room::furniture::{legs, pad};
use crate::room::shape::{Modeller, Projection};
use crate::room::texture::{SPINES, hash};
use glam::{DVec2, DVec3};

/// A table with a slab and four round legs.
pub fn table(m: &mut Modeller, width: f64, depth: f64, height: f64) {
    let [left, back] = [-width * 0.5, -depth * 0.5];
    let slab = [left, height - 0.035, back];
    pad(m, slab, [width, 0.035, depth], 0.012);
    let shelf = [left + 0.09, 0.15, back + 0.07];
    pad(m, shelf, [width - 0.18, 0.02, depth - 0.14], 0.006);
    let half = [width * 0.5 - 0.09, depth * 0.5 - 0.08];
    legs(m, half, height - 0.03, [0.03, 0.02], [0.014, 0.022]);
}

/// Heights of the boards of [`bookcase`], floor to top.
pub const BOARDS: [f64; 6] = [0.06, 0.43, 0.78, 1.12, 1.45, 1.76];

/// An open bookcase with a back panel.
pub fn bookcase(m: &mut Modeller, width: f64, depth: f64) {
    let (half, back, front) = (width * 0.5, -depth * 0.5, depth * 0.5);
    let mut cuboid = |low: [f64; 3], high: [f64; 3]| m.cuboid(low.into(), high.into());
    let top = BOARDS[BOARDS.len() - 1];
    for x in [-half, half - 0.025] {
        cuboid([x, 0.0, back], [x + 0.025, top + 0.025, front]);
    }
    let (left, right) = (-half + 0.025, half - 0.025);
    cuboid([left, 0.06, back], [right, top, back + 0.012]);
    for y in BOARDS {
        let high = [right, y + 0.025, front - 0.002];
        cuboid([left, y, back + 0.012], high);
    }
}

/// Books on the boards of [`bookcase`], textured by columns of the spine picture.
pub fn books(m: &mut Modeller, width: f64, depth: f64) {
    let mut spine = 0;
    for (shelf, pair) in BOARDS.windows(2).enumerate() {
        let shelf = shelf as u32;
        let (floor, room) = (pair[0] + 0.025, pair[1] - pair[0] - 0.025);
        // Shelves are filled from alternating sides, none completely.
        let fill = (0.55 + 0.4 * f64::from(hash(shelf, 99))) * (width - 0.06);
        let from_right = shelf % 2 == 1;
        let mut along = 0.0;
        while along < fill {
            let thick = 0.028 + 0.034 * f64::from(hash(spine, shelf));
            let tall = room * (0.62 + 0.30 * f64::from(hash(spine, shelf + 10)));
            let deep = depth * (0.62 + 0.2 * f64::from(hash(spine, shelf + 20)));
            let x = if from_right {
                width * 0.5 - 0.028 - along - thick
            } else {
                -width * 0.5 + 0.028 + along
            };
            let column = (f64::from(spine % SPINES) + 0.5) / f64::from(SPINES);
            m.projection = Some(Projection {
                origin: m.placement.transform_point3(DVec3::new(x, floor, 0.0)),
                u_axis: DVec3::ZERO,
                v_axis: DVec3::Y / tall,
                offset: DVec2::new(column, 0.0),
            });
            let front = depth * 0.5 - 0.03;
            let low = DVec3::new(x, floor, front - deep);
            m.cuboid(low, DVec3::new(x + thick - 0.001, floor + tall, front));
            along += thick + 0.001;
            spine += 1;
        }
    }
}

/// A low cabinet with two door panels on slender feet.
pub fn sideboard(m: &mut Modeller, width: f64, depth: f64, height: f64) {
    let size = [width, height - 0.16, depth - 0.015];
    pad(m, [-width * 0.5, 0.16, -depth * 0.5], size, 0.01);
    let panel = [width * 0.5 - 0.03, height - 0.22, 0.02];
    for x in [-width * 0.5 + 0.02, 0.01] {
        pad(m, [x, 0.19, depth * 0.5 - 0.02], panel, 0.006);
    }
    let half = [width * 0.5 - 0.12, depth * 0.5 - 0.08];
    legs(m, half, 0.165, [0.0; 2], [0.012, 0.018]);
}

/// A door leaf with two panels, handle and casing; its face is near z = 0.
pub fn door(m: &mut Modeller) {
    let (half, height, casing) = (0.86 * 0.5, 2.02, 0.07);
    let cuboid =
        |m: &mut Modeller, low: [f64; 3], high: [f64; 3]| m.cuboid(low.into(), high.into());
    cuboid(m, [-half, 0.0, -0.02], [half, height, 0.02]);
    for (low, high) in [(0.15, 0.85), (1.0, 1.87)] {
        pad(m, [-0.30, low, 0.015], [0.60, high - low, 0.017], 0.006);
    }
    let top = height + casing;
    for x in [-half - casing, half] {
        cuboid(m, [x, 0.0, -0.02], [x + casing, top, 0.035]);
    }
    cuboid(m, [-half, height, -0.02], [half, top, 0.035]);
    let handle = DVec3::new(-0.36, 1.02, 0.0);
    m.bar(handle, handle + DVec3::Z * 0.07, [0.012, 0.012], 8);
    let grip = handle + DVec3::new(-0.01, 0.0, 0.065);
    m.bar(grip, grip + DVec3::X * 0.13, [0.011, 0.009], 8);
}

/// A frame of four bars in the xy plane, extending towards +z.
pub fn rim(m: &mut Modeller, width: f64, height: f64, thick: f64, deep: f64) {
    let (x, y) = (width * 0.5, height * 0.5);
    for sign in [-1.0, 1.0] {
        let mut bar = |center: [f64; 2], size: [f64; 2]| {
            let [center, size] = [center, size].map(DVec2::from);
            let half = size.extend(deep) * 0.5;
            m.rounded_box(center.extend(deep * 0.5), half, 0.0, 0);
        };
        bar([sign * (x - thick * 0.5), 0.0], [thick, height]);
        let inner = width - 2.0 * thick;
        bar([0.0, sign * (y - thick * 0.5)], [inner, thick]);
    }
}
