//! Where a view of the mesh should show edges: between neighbouring pixels that see different surfaces.

use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{Vec2, Vec3};

/// A neighbour that lies off a pixel's plane by more than this many pixel footprints is another surface.
const JUMP_FOOTPRINTS: f32 = 6.0;
/// A crease turns the mean normals of two 3 × 3 blocks of pixels by more than arccos(1 − 0.2) = 37°: what a mesh fused from
/// noisy depth does not do on flat walls.
const CREASE: f32 = 0.2;
/// Of the nine unit normals of a block, the length of the sum from which their mean is a direction.
const COHERENT: f32 = 5.0;

/// Which neighbour an edge is towards.
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

/// Edges by what makes them.
#[derive(Debug, Clone, Default)]
pub struct Edges {
    /// Jumps of depth, creases, borders of objects, and outlines of the mesh.
    pub kinds: [Vec<Edge>; 4],
}

const JUMP: usize = 0;
const FOLD: usize = 1;
const BORDER: usize = 2;
const OUTLINE: usize = 3;

/// What the centre of a pixel sees.
#[derive(Clone, Copy)]
struct Seen {
    point: Vec3,
    /// Unit normal of the side that is seen.
    normal: Vec3,
    object: u32,
    distance: f32,
}

/// The edges that a camera should see.
pub fn edges(scene: &Scene, camera: &Camera) -> Edges {
    let lens = &camera.intrinsics;
    let (width, height) = (lens.width as i32, lens.height as i32);
    let at = |x: i32, y: i32| (y * width + x) as usize;
    let seen: Vec<Option<Seen>> = (0..width * height)
        .map(|pixel| look(scene, camera, pixel % width, pixel / width))
        .collect();
    let normal = |x: i32, y: i32| {
        let inside = x >= 0 && y >= 0 && x < width && y < height;
        inside
            .then(|| seen[at(x, y)])
            .flatten()
            .map_or(Vec3::ZERO, |s| s.normal)
    };

    // How much the surface turns across each edge.
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
                let kind = match (seen[at(x, y)], seen[at(x + dx, y + dy)]) {
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
                            JUMP
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

/// What the centre of a pixel sees.
fn look(scene: &Scene, camera: &Camera, x: i32, y: i32) -> Option<Seen> {
    let ray = camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
    let hit = scene.intersect(&ray)?;
    let normal = scene.normals[hit.triangle as usize];
    let point = scene.point(&hit);
    Some(Seen {
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
