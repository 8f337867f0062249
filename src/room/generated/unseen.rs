//! Rooms whose lamps no photograph sees: in bowls and coves above eye level, or outside of all fields of view.

use crate::room::cameras::View;
use crate::room::furniture::vessels;
use crate::room::generated::furnisher::{EYE_HEIGHT, Furnisher};
use crate::transport::material::Material;
use glam::{DAffine3, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Attempts at finding a place outside of all fields of view.
const ATTEMPTS: u32 = 60;
/// Lamps that face upwards are at most at this fraction of the way from eye level to the ceiling.
const MAX_LIFT: f64 = 0.3;
/// Radius around a lamp that is kept out of all fields of view, relative to the lamp's.
const CLEARANCE: f64 = 1.2;

/// A plain room whose lamps face upwards from above eye level, or hang outside of all fields of view.
pub fn furnish(f: &mut Furnisher, size: [u32; 2]) {
    f.shell();
    f.furniture();
    f.look_around(4, 10);
    let brightness = f.scaled(0.3, 300.0);
    let aspect = f64::from(size[1]) / f64::from(size[0].max(1));
    for index in 0..f.count(1, 4) {
        let lamp = f.luminous(brightness);
        let name = format!("lamp-{index}");
        match f.count(0, 2) {
            0 => bowl(f, index, &name, lamp),
            1 => cove(f, index, &name, lamp),
            _ => {
                // If photographs see the whole room, hide the lamp in a bowl.
                if !unseen_box(f, &name, &lamp, aspect) {
                    bowl(f, index, &name, lamp);
                }
            }
        }
    }
    f.expose(32.0, 96.0);
}

/// An opaque hanging bowl with a lamp in it that lights the ceiling.
fn bowl(f: &mut Furnisher, index: usize, name: &str, lamp: Material) {
    let radius = f.scaled(0.15, 0.35);
    let at = f.place(radius);
    let rim = 0.52 * radius;
    // The rim hides the lamp from below. Near the ceiling the lit spot would be too small for paths to find.
    let lowest = EYE_HEIGHT[1] + 0.05;
    let height = f.between(lowest, lowest + MAX_LIFT * (f.size.y - rim - lowest));
    let place = DAffine3::from_translation(DVec3::new(at.x, height, at.y));
    f.plain(&format!("bowl-{index}"), [0.1, 0.9], |m| {
        m.placed(place, |m| vessels::bowl(m, radius));
    });
    let side = 0.7 * radius;
    let corner = DVec3::new(-0.5 * side, 0.3 * radius, 0.5 * side);
    f.object(name, lamp, |m| {
        m.placed(place, |m| {
            m.grid(corner, DVec3::X * side, DVec3::NEG_Z * side, 2, 2)
        });
    });
}

/// A ledge along a wall with a light strip on its top.
fn cove(f: &mut Furnisher, index: usize, name: &str, lamp: Material) {
    let along_x = f.count(0, 1) == 0;
    let side = [-1.0, 1.0][f.count(0, 1)];
    let (length, across, turn) = match along_x {
        true => (f.size.x, f.size.z, DAffine3::IDENTITY),
        false => (f.size.z, f.size.x, DAffine3::from_rotation_y(FRAC_PI_2)),
    };
    let length = length * f.between(0.3, 0.95);
    let (deep, thick) = (f.between(0.12, 0.25), 0.04);
    let lowest = EYE_HEIGHT[1] + 0.1;
    let top = f.between(lowest, lowest + MAX_LIFT * (f.size.y - lowest));
    // Local coordinates with x along the wall.
    let middle = side * (across * 0.5 - deep * 0.5 - 0.005);
    f.plain(&format!("ledge-{index}"), [0.3, 0.9], |m| {
        m.placed(turn, |m| {
            let low = DVec3::new(-0.5 * length, top - thick, middle - 0.5 * deep);
            m.cuboid(low, DVec3::new(0.5 * length, top, middle + 0.5 * deep));
        });
    });
    let (long, wide) = (length * 0.96, deep * 0.4);
    let corner = DVec3::new(-0.5 * long, top + 0.005, middle + 0.5 * wide);
    f.object(name, lamp, |m| {
        m.placed(turn, |m| {
            m.grid(corner, DVec3::X * long, DVec3::NEG_Z * wide, 8, 1)
        });
    });
}

/// Adds a lamp below the ceiling that no photograph sees. Returns whether there was a place for it.
fn unseen_box(f: &mut Furnisher, name: &str, lamp: &Material, aspect: f64) -> bool {
    for _ in 0..ATTEMPTS {
        let half = DVec3::from([(); 3].map(|()| f.scaled(0.05, 0.15)));
        let radius = half.length();
        let at = f.place(radius);
        let below = f.between(0.05, 0.5) + half.y;
        let center = DVec3::new(at.x, f.size.y - below, at.y);
        let hidden = |view: &View| is_outside(view, center, radius * CLEARANCE, aspect);
        if f.views.iter().all(hidden) {
            f.object(name, lamp.clone(), |m| m.rounded_box(center, half, 0.0, 0));
            return true;
        }
    }
    false
}

/// Whether a ball lies completely outside of a field of view whose height is `aspect` times its width.
fn is_outside(view: &View, center: DVec3, radius: f64, aspect: f64) -> bool {
    let p = view.pose.rotation.transpose() * (center - view.pose.center);
    let ahead = -p.z;
    let outside = |offset: f64, slope: f64| {
        offset.abs() - slope * ahead > radius * (1.0 + slope * slope).sqrt()
    };
    ahead < -radius || outside(p.x, view.half_field) || outside(p.y, view.half_field * aspect)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_beside_a_field_where_no_part_of_it_reaches_in() {
        let view = View::towards(DVec3::ZERO, DVec3::NEG_Z * 2.0);
        let edge = 2.0 * view.half_field;
        let outside = |x: f64, y: f64, z: f64| is_outside(&view, DVec3::new(x, y, z), 0.1, 0.75);
        assert!(!outside(0.0, 0.0, -2.0));
        assert!(!outside(edge + 0.12, 0.0, -2.0) && outside(edge + 0.14, 0.0, -2.0));
        assert!(!outside(0.0, 0.75 * edge + 0.11, -2.0) && outside(0.0, 0.75 * edge + 0.13, -2.0));
        assert!(outside(0.0, 0.0, 0.11) && !outside(0.0, 0.0, 0.05));
    }
}
