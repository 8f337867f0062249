//! Edges of the mesh in a camera's image: pairs of neighbouring pixels that see different surfaces.

use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{Vec2, Vec3};

/// Distance of a neighbour from a pixel's plane, in pixel footprints, that makes a depth edge.
const JUMP_FOOTPRINTS: f32 = 6.0;
/// One minus the cosine between the mean normals of adjacent 3 × 3 blocks that makes a crease: 37°. Flat walls of a mesh
/// fused from noisy depth stay below.
const CREASE: f32 = 0.2;
/// Least length of the sum of a block's nine unit normals for which their mean counts.
const COHERENT: f32 = 5.0;

/// The neighbour on the other side of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Towards {
    /// The pixel to the right.
    Right,
    /// The pixel below.
    Down,
}

/// An edge between a pixel and its neighbour.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    /// Column of the pixel.
    pub x: i32,
    /// Row of the pixel.
    pub y: i32,
    /// The neighbour.
    pub towards: Towards,
}

/// Edges by kind.
#[derive(Debug, Clone, Default)]
pub struct Edges {
    /// Depth discontinuities, creases, borders between objects, and outlines of the mesh.
    pub kinds: [Vec<Edge>; 4],
}

const DEPTH: usize = 0;
const FOLD: usize = 1;
const BORDER: usize = 2;
const OUTLINE: usize = 3;

/// The surface point that a pixel's centre sees.
#[derive(Clone, Copy)]
struct PixelHit {
    point: Vec3,
    /// Unit normal of the side that is seen.
    normal: Vec3,
    object: u32,
    distance: f32,
}

/// The edges of the mesh in a camera's image.
pub fn edges(scene: &Scene, camera: &Camera) -> Edges {
    let lens = &camera.intrinsics;
    let (width, height) = (lens.width as i32, lens.height as i32);
    let at = |x: i32, y: i32| (y * width + x) as usize;
    let hits: Vec<Option<PixelHit>> = (0..width * height)
        .map(|pixel| pixel_hit(scene, camera, pixel % width, pixel / width))
        .collect();
    let normal = |x: i32, y: i32| {
        let inside = x >= 0 && y >= 0 && x < width && y < height;
        inside
            .then(|| hits[at(x, y)])
            .flatten()
            .map_or(Vec3::ZERO, |hit| hit.normal)
    };

    // One minus the cosine between the mean normals on both sides of each pair of pixels.
    let turn = |x: i32, y: i32, towards: Towards| {
        let (mut before, mut after) = (Vec3::ZERO, Vec3::ZERO);
        for along in -1..=1 {
            for away in 0..3 {
                let ([x0, y0], [x1, y1]) = match towards {
                    Towards::Right => ([x - away, y + along], [x + 1 + away, y + along]),
                    Towards::Down => ([x + along, y - away], [x + along, y + 1 + away]),
                };
                before += normal(x0, y0);
                after += normal(x1, y1);
            }
        }
        let lengths = before.length().min(after.length());
        match lengths > COHERENT {
            true => 1.0 - before.dot(after) / (before.length() * after.length()),
            false => 0.0,
        }
    };
    let turns = [Towards::Right, Towards::Down].map(|towards| -> Vec<f32> {
        (0..width * height)
            .map(|pixel| turn(pixel % width, pixel / width, towards))
            .collect()
    });

    let footprint = 1.0 / lens.fx.abs() as f32;
    let mut edges = Edges::default();
    for y in 0..height {
        for x in 0..width {
            for (towards, turns) in [Towards::Right, Towards::Down].into_iter().zip(&turns) {
                let (dx, dy) = match towards {
                    Towards::Right => (1, 0),
                    Towards::Down => (0, 1),
                };
                if x + dx >= width || y + dy >= height {
                    continue;
                }
                let kind = match (hits[at(x, y)], hits[at(x + dx, y + dy)]) {
                    (None, None) => continue,
                    (None, Some(_)) | (Some(_), None) => OUTLINE,
                    (Some(a), Some(b)) => {
                        let step = b.point - a.point;
                        let off = (a.normal.dot(step).abs()).min(b.normal.dot(step).abs());
                        let turned = turns[at(x, y)];
                        let sharpest = [(x - dx, y - dy), (x + dx, y + dy)]
                            .into_iter()
                            .filter(|&(x, y)| x >= 0 && y >= 0)
                            .all(|(x, y)| turned >= turns[at(x, y)]);
                        if off > JUMP_FOOTPRINTS * footprint * a.distance.min(b.distance) {
                            DEPTH
                        } else if turned > CREASE && sharpest {
                            FOLD
                        } else if a.object != b.object {
                            BORDER
                        } else {
                            continue;
                        }
                    }
                };
                edges.kinds[kind].push(Edge { x, y, towards });
            }
        }
    }
    edges
}

fn pixel_hit(scene: &Scene, camera: &Camera, x: i32, y: i32) -> Option<PixelHit> {
    let ray = camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
    let hit = scene.intersect(&ray)?;
    let normal = scene.normals[hit.triangle as usize];
    let point = scene.point(&hit);
    Some(PixelHit {
        point,
        normal: if normal.dot(ray.direction) > 0.0 {
            -normal
        } else {
            normal
        },
        object: scene.object_of[hit.triangle as usize],
        distance: (point - camera.center).length(),
    })
}
