//! Rooms full of small objects.

use crate::room::furniture::woodwork;
use crate::room::generated::furnisher::{Furnisher, Support};
use glam::{DAffine3, DVec2, DVec3};

/// Range of the number of objects.
const COUNT: [f64; 2] = [300.0, 1000.0];
/// Most objects per square metre of floor, so that small rooms have space for them.
const DENSITY: f64 = 60.0;
/// Range of the radius of an object in metres.
const RADIUS: [f64; 2] = [0.015, 0.07];
/// Attempts at finding a free place before the object is made smaller.
const ATTEMPTS: u32 = 20;

/// A plain room with shelves, and hundreds of boxes, cylinders and cones on floor, furniture and shelves.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    for index in 0..f.count(1, 3) {
        shelves(f, index);
    }
    f.furniture();
    let floor = Support {
        place: DAffine3::IDENTITY,
        half: DVec2::new(f.size.x, f.size.z) * 0.5 - 0.05,
        headroom: f.size.y,
    };
    let blocked = f.occupied.clone();
    let mut supports = vec![floor];
    supports.append(&mut f.supports);
    let mut places: Vec<Vec<(DVec2, f64)>> = vec![Vec::new(); supports.len()];
    places[0] = blocked;
    let max = (DENSITY * f.size.x * f.size.z).clamp(COUNT[0], COUNT[1]);
    let wanted = f.scaled(COUNT[0], max.max(COUNT[0] + 1.0)) as usize;
    for index in 0..wanted {
        thing(f, index, &supports, &mut places);
    }
    f.look_around(6, 12);
    f.expose(8.0, 48.0);
}

/// An open bookcase whose boards support objects.
fn shelves(f: &mut Furnisher, index: usize) {
    let (width, depth) = (f.between(0.6, 1.1), f.between(0.25, 0.4));
    let radius = 0.5 * width.hypot(depth);
    let Some(at) = f.free(radius) else {
        return;
    };
    let turn = DAffine3::from_rotation_y(f.between(0.0, std::f64::consts::TAU));
    let place = DAffine3::from_translation(DVec3::new(at.x, 0.0, at.y)) * turn;
    f.plain(&format!("shelves-{index}"), [0.1, 0.9], |m| {
        m.placed(place, |m| woodwork::bookcase(m, width, depth));
    });
    let boards = woodwork::BOARDS;
    for (board, above) in boards.iter().zip(boards.iter().skip(1)) {
        f.supports.push(Support {
            place: place * DAffine3::from_translation(DVec3::Y * (board + 0.025)),
            half: DVec2::new(width, depth) * 0.5 - 0.03,
            headroom: above - board - 0.03,
        });
    }
}

/// Adds an object at a free place, shrinking it until it fits.
fn thing(f: &mut Furnisher, index: usize, supports: &[Support], places: &mut [Vec<(DVec2, f64)>]) {
    let mut radius = f.scaled(RADIUS[0], RADIUS[1]);
    let (which, at) = loop {
        if let Some(found) = free(f, radius, supports, places) {
            break found;
        }
        radius *= 0.7;
    };
    let support = supports[which];
    places[which].push((at, radius));
    let height = (radius * f.scaled(0.5, 5.0)).min(support.headroom * 0.95);
    let turn = DAffine3::from_rotation_y(f.between(0.0, std::f64::consts::TAU));
    let place = support.place * DAffine3::from_translation(DVec3::new(at.x, 0.001, at.y)) * turn;
    let aspect = f.between(0.4, 0.9);
    let half = DVec3::new(aspect, 0.0, (1.0 - aspect * aspect).sqrt()) * radius;
    let kind = f.count(0, 3);
    f.plain(&format!("thing-{index}"), [0.03, 0.9], |m| {
        m.placed(place, |m| match kind {
            0 => m.lathe(&[[radius, 0.0], [radius, height]], 8),
            1 => m.lathe(&[[0.6 * radius, 0.0], [radius, height]], 8),
            2 => m.lathe(&[[radius, 0.0], [0.3 * radius, height]], 8),
            _ => {
                let half = half + DVec3::Y * height * 0.5;
                m.rounded_box(DVec3::Y * height * 0.5, half, 0.0, 0);
            }
        });
    });
}

/// A support and a free place on it for a radius. Half of the attempts are on the floor.
fn free(
    f: &mut Furnisher,
    radius: f64,
    supports: &[Support],
    places: &[Vec<(DVec2, f64)>],
) -> Option<(usize, DVec2)> {
    for _ in 0..ATTEMPTS {
        let which = match f.count(0, 1) {
            0 => 0,
            _ => f.count(0, supports.len() - 1),
        };
        let reach = supports[which].half - radius;
        let fraction = DVec2::from([(); 2].map(|()| f.between(-1.0, 1.0)));
        let at = reach * fraction;
        let clear = |(center, other): &(DVec2, f64)| at.distance(*center) > radius + other;
        if reach.min_element() > 0.0 && places[which].iter().all(clear) {
            return Some((which, at));
        }
    }
    None
}
