//! Rooms lit by sky and sun through openings in their walls.

use crate::room::generated::furnisher::{Furnisher, walls};
use crate::room::generated::sky::{KINDS, Sky};
use crate::room::shape::Modeller;
use crate::transport::environment::{Environment, directions};
use crate::transport::sun::Sun;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Width and height of the environment map; a pixel has about three degrees.
const MAP: [usize; 2] = [128, 64];

/// An opening in a wall, in fractions of the wall's width and height.
pub struct Opening {
    wall: usize,
    across: [f64; 2],
    up: [f64; 2],
    /// Thickness of the wall in metres.
    reveal: f64,
}

/// A plain room with one or two openings; in two of five rooms with a weak lamp.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    let openings = shell(f);
    f.furniture();
    f.look_around(3, 6);
    look_out(f, &openings);
    f.expose(48.0, 128.0);
}

/// Adds a shell with openings, the light from outside, and in two of five rooms a weak lamp.
pub fn shell(f: &mut Furnisher) -> Vec<Opening> {
    let openings = openings(f);
    f.shell_with(
        |m, wall, sides| match openings.iter().find(|opening| opening.wall == wall) {
            Some(opening) => around(m, opening, sides),
            None => m.grid(sides[0], sides[1], sides[2], 4, 4),
        },
    );
    let walls = walls(f.size);
    f.plain("reveals", [0.3, 0.92], |m| {
        for opening in &openings {
            reveal(m, opening, walls[opening.wall]);
        }
    });
    let level = f.scaled(0.3, 30.0);
    f.outside = outside(f, level, &openings[0]).map(Arc::new);
    if f.between(0.0, 1.0) < 0.4 {
        f.lamp(0, level * 0.5);
    }
    openings
}

/// Adds views towards the openings, past their centres.
pub fn look_out(f: &mut Furnisher, openings: &[Opening]) {
    let walls = walls(f.size);
    for opening in openings {
        let eye = f.eye();
        let [corner, u, v] = opening_sides(opening, walls[opening.wall]);
        let [s, t] = [(); 2].map(|()| f.between(-0.3, 1.3));
        f.look(eye, corner + u * s + v * t);
    }
}

fn openings(f: &mut Furnisher) -> Vec<Opening> {
    let first = f.count(0, 3);
    let second = (first + f.count(1, 3)) % 4;
    let count = f.count(1, 2);
    [first, second][..count]
        .iter()
        .map(|&wall| {
            let wide = f.between(0.3, 0.8);
            let left = f.between(0.05, 0.95 - wide);
            let sill = f.between(0.02, 0.4);
            Opening {
                wall,
                across: [left, left + wide],
                up: [sill, f.between(sill + 0.45, 0.95)],
                reveal: f.between(0.05, 0.3),
            }
        })
        .collect()
}

/// The opening's range along each side of its wall.
fn ranges(opening: &Opening, [_, u, v]: [DVec3; 3]) -> [[f64; 2]; 2] {
    [u, v].map(|side| match side.y {
        0.0 => opening.across,
        rise if rise > 0.0 => opening.up,
        _ => [1.0 - opening.up[1], 1.0 - opening.up[0]],
    })
}

/// Corner and sides of an opening.
fn opening_sides(opening: &Opening, sides: [DVec3; 3]) -> [DVec3; 3] {
    let [corner, u, v] = sides;
    let [s, t] = ranges(opening, sides);
    [
        corner + u * s[0] + v * t[0],
        u * (s[1] - s[0]),
        v * (t[1] - t[0]),
    ]
}

/// The wall around an opening.
fn around(m: &mut Modeller, opening: &Opening, sides: [DVec3; 3]) {
    let [corner, u, v] = sides;
    let [s, t] = ranges(opening, sides);
    let mut part = |s: [f64; 2], t: [f64; 2]| {
        let low = corner + u * s[0] + v * t[0];
        m.grid(low, u * (s[1] - s[0]), v * (t[1] - t[0]), 2, 2);
    };
    part([0.0, 1.0], [0.0, t[0]]);
    part([0.0, 1.0], [t[1], 1.0]);
    part([0.0, s[0]], t);
    part([s[1], 1.0], t);
}

/// The four inner faces of an opening through the thickness of its wall.
fn reveal(m: &mut Modeller, opening: &Opening, sides: [DVec3; 3]) {
    let [corner, u, v] = opening_sides(opening, sides);
    let out = -u.cross(v).normalize_or_zero() * opening.reveal;
    m.grid(corner, u, out, 2, 1);
    m.grid(corner + v, out, u, 1, 2);
    m.grid(corner, out, v, 1, 2);
    m.grid(corner + u, v, out, 2, 1);
}

/// One of the standard skies of about a radiance, bluer where it is darker, over dark ground; in three of five rooms with a sun
/// shining into an opening.
fn outside(f: &mut Furnisher, level: f64, opening: &Opening) -> Option<Environment> {
    let tint = f.color(1.0, 0.4);
    let ground = f.color(1.0, 0.5) * f.between(0.1, 0.4) as f32;
    let shines = f.between(0.0, 1.0) < 0.6;
    let [_, u, v] = walls(f.size)[opening.wall];
    let out = -u.cross(v).normalize_or_zero();
    // A sun that does not shine in stands behind the room.
    let azimuth = out.z.atan2(out.x) + f.between(-1.1, 1.1) + if shines { 0.0 } else { PI };
    let elevation = f.between(0.15, 1.0);
    let (sin, cos) = elevation.sin_cos();
    let towards = DVec3::new(cos * azimuth.cos(), sin, cos * azimuth.sin()).as_vec3();
    let sky = Sky {
        kind: f.count(0, KINDS - 1),
        sun: towards,
    };
    // Luminance to the power of one plus this in red, and minus this in blue.
    let blueness = f.between(0.0, 0.3) as f32;
    // The sun's irradiance relative to that of a uniform sky.
    let strength = f.scaled(0.3, 6.0);
    let warmth = f.color(1.0, 0.3);

    let [width, height] = MAP;
    let directions: Vec<Vec3> = directions(MAP).collect();
    let is_sky = |direction: &&Vec3| direction.y > 0.0;
    let solid_angle = |d: &Vec3| (1.0 - d.y * d.y).sqrt();
    let above = || directions.iter().filter(is_sky);
    let sum: f32 = above().map(|d| sky.luminance(*d) * solid_angle(d)).sum();
    let mean = sum / above().map(solid_angle).sum::<f32>();
    let pixels = (directions.iter())
        .map(|direction| {
            let light = if direction.y > 0.0 {
                let relative = sky.luminance(*direction) / mean;
                let red = relative.powf(blueness);
                tint * relative * Vec3::new(red, 1.0, red.recip())
            } else {
                ground
            };
            light * level as f32
        })
        .collect();
    let sun = shines.then(|| Sun {
        direction: towards,
        irradiance: warmth * (strength * PI * level) as f32,
    });
    Environment::new(width, height, pixels)?.with_sun(sun, None)
}
