//! Rooms with textures on most surfaces.

use crate::math::picture::Picture;
use crate::room::build::print;
use crate::room::generated::furnisher::Furnisher;
use crate::room::texture::hash;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// Side of a pattern's picture in pixels.
const SIDE: u32 = 128;
/// Range of a pattern's period in metres.
const PERIOD: [f64; 2] = [0.25, 2.0];
/// Fraction of the objects that have a pattern.
const FRACTION: f64 = 0.85;

/// A plain room most of whose objects have a pattern.
pub fn furnish(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    paint(f, FRACTION);
    f.look_around(6, 12);
    f.expose(16.0, 64.0);
}

/// Gives the floor, and each other object that is no lamp with probability `fraction`, stripes, checks, noise or a print.
pub fn paint(f: &mut Furnisher, fraction: f64) {
    let mut chosen = Vec::new();
    for object in 0..f.materials.len() {
        let is_lamp = f.materials[object].emission != Vec3::ZERO;
        // The floor, the most visible object, always has a pattern.
        if !is_lamp && (object == 0 || f.between(0.0, 1.0) < fraction) {
            project(f, object as u32);
            chosen.push((object, pattern(f)));
        }
    }
    print(&mut f.materials, &f.modeller.mesh, chosen);
}

/// Sets an object's texture coordinates by projecting each triangle along its dominant axis, rotated by a random angle.
fn project(f: &mut Furnisher, object: u32) {
    let period = f.scaled(PERIOD[0], PERIOD[1]);
    let turn = DVec2::from_angle(f.between(0.0, std::f64::consts::TAU));
    let mesh = &mut f.modeller.mesh;
    for triangle in 0..mesh.triangles.len() {
        if mesh.object_of[triangle] != object {
            continue;
        }
        let corners = mesh.triangles[triangle].map(|i| mesh.positions[i as usize]);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).abs();
        let flat = |p: DVec3| match normal.max_element() {
            max if max == normal.x => DVec2::new(p.z, p.y),
            max if max == normal.y => DVec2::new(p.x, p.z),
            _ => DVec2::new(p.x, p.y),
        };
        mesh.corner_uvs[triangle] = corners.map(|p| (turn.rotate(flat(p)) / period).as_vec2());
    }
}

/// Draws a seamless pattern of two or three colours.
fn pattern(f: &mut Furnisher) -> Picture {
    let colors = [(); 3].map(|()| {
        let value = f.between(0.05, 0.9);
        let saturation = f.between(0.0, 0.8);
        f.color(value, saturation)
    });
    let kind = f.count(0, 3);
    let repeats = f.count(1, 4) as f32;
    let key = f.count(0, 1 << 20) as u32;
    Picture::from_fn(SIDE, SIDE, |x, y| {
        let p = (Vec2::new(x as f32, y as f32) + 0.5) / SIDE as f32;
        match kind {
            0 => stripes(p, repeats, &colors),
            1 => checks(p, repeats, &colors),
            2 => colors[0].lerp(colors[1], noise(p, key)),
            _ => discs(p, repeats, key, &colors),
        }
    })
}

fn stripes(p: Vec2, repeats: f32, colors: &[Vec3; 3]) -> Vec3 {
    match (p.x * repeats).fract() {
        along if along < 0.45 => colors[0],
        along if along < 0.55 => colors[2],
        _ => colors[1],
    }
}

fn checks(p: Vec2, repeats: f32, colors: &[Vec3; 3]) -> Vec3 {
    let cell = (p * repeats * 2.0).floor();
    colors[((cell.x + cell.y) as usize) % 2]
}

/// Smooth value noise of two octaves, 0 to 1.
fn noise(p: Vec2, key: u32) -> f32 {
    let octave = |cells: u32| {
        let q = p * cells as f32;
        let at = |dx: u32, dy: u32| {
            let cell = [q.x as u32 + dx, q.y as u32 + dy].map(|i| i % cells);
            hash(cell[0] + 64 * cell[1], key + cells)
        };
        let t = q.fract();
        let t = t * t * (3.0 - 2.0 * t);
        let low = at(0, 0) + (at(1, 0) - at(0, 0)) * t.x;
        let high = at(0, 1) + (at(1, 1) - at(0, 1)) * t.x;
        low + (high - low) * t.y
    };
    0.6 * octave(5) + 0.4 * octave(17)
}

/// Discs of different sizes, each with a rim.
fn discs(p: Vec2, repeats: f32, key: u32, colors: &[Vec3; 3]) -> Vec3 {
    let q = p * repeats * 2.0;
    let cell = q.floor();
    let radius = 0.2 + 0.25 * hash(cell.x as u32 + 64 * cell.y as u32, key);
    match (q - cell - 0.5).length() / radius {
        within if within < 0.75 => colors[1],
        within if within < 1.0 => colors[2],
        _ => colors[0],
    }
}
