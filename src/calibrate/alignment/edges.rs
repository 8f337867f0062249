//! Edges of the mesh in a camera's image: pairs of neighbouring pixels that see different surfaces.

use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{IVec2, Vec3};

/// Distance of a neighbour from a pixel's plane, in pixel footprints, that makes a depth edge.
const JUMP_FOOTPRINTS: f32 = 6.0;
/// One minus the cosine between the mean normals of adjacent 3 × 3 blocks that makes a crease: 37°. Flat walls of a mesh
/// fused from noisy depth stay below.
const CREASE: f32 = 0.2;
/// Least length of the sum of a block's nine unit normals for which their mean counts.
const COHERENT: f32 = 5.0;

/// An edge between a pixel and a neighbour.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    /// Column and row of the pixel.
    pub pixel: IVec2,
    /// 0 if the neighbour is the pixel to the right, 1 if it is the one below.
    pub axis: usize,
}

/// Edges by kind: depth discontinuities, creases, borders between objects, and outlines of the mesh.
pub type Edges = [Vec<Edge>; 4];

const DEPTH: usize = 0;
const FOLD: usize = 1;
const BORDER: usize = 2;
const OUTLINE: usize = 3;

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
    let size = IVec2::new(lens.width as i32, lens.height as i32);
    let is_inside = |p: IVec2| p.cmpge(IVec2::ZERO).all() && p.cmplt(size).all();
    let at = |p: IVec2| (p.y * size.x + p.x) as usize;
    let pixels = || (0..size.y).flat_map(move |y| (0..size.x).map(move |x| IVec2::new(x, y)));
    let hits: Vec<Option<PixelHit>> = pixels().map(|p| pixel_hit(scene, camera, p)).collect();
    let normal = |p: IVec2| {
        let hit = is_inside(p).then(|| hits[at(p)]).flatten();
        hit.map_or(Vec3::ZERO, |hit| hit.normal)
    };

    // One minus the cosine between the mean normals on both sides of each pair of pixels.
    let turn = |pixel: IVec2, axis: usize| {
        let (ahead, beside) = (IVec2::AXES[axis], IVec2::AXES[1 - axis]);
        let (mut before, mut after) = (Vec3::ZERO, Vec3::ZERO);
        for along in -1..=1 {
            for away in 0..3 {
                before += normal(pixel + along * beside - away * ahead);
                after += normal(pixel + along * beside + (1 + away) * ahead);
            }
        }
        let lengths = before.length().min(after.length());
        match lengths > COHERENT {
            true => 1.0 - before.dot(after) / (before.length() * after.length()),
            false => 0.0,
        }
    };
    let turns = [0, 1].map(|axis| pixels().map(|p| turn(p, axis)).collect::<Vec<f32>>());

    let footprint = 1.0 / lens.fx.abs() as f32;
    let mut edges = Edges::default();
    for pixel in pixels() {
        for (axis, turns) in turns.iter().enumerate() {
            let step = IVec2::AXES[axis];
            if !is_inside(pixel + step) {
                continue;
            }
            let kind = match (hits[at(pixel)], hits[at(pixel + step)]) {
                (None, None) => continue,
                (None, Some(_)) | (Some(_), None) => OUTLINE,
                (Some(a), Some(b)) => {
                    let between = b.point - a.point;
                    let off = (a.normal.dot(between).abs()).min(b.normal.dot(between).abs());
                    let turned = turns[at(pixel)];
                    let is_sharpest = [pixel - step, pixel + step]
                        .into_iter()
                        .all(|p| !is_inside(p) || turned >= turns[at(p)]);
                    if off > JUMP_FOOTPRINTS * footprint * a.distance.min(b.distance) {
                        DEPTH
                    } else if turned > CREASE && is_sharpest {
                        FOLD
                    } else if a.object != b.object {
                        BORDER
                    } else {
                        continue;
                    }
                }
            };
            edges[kind].push(Edge { pixel, axis });
        }
    }
    edges
}

fn pixel_hit(scene: &Scene, camera: &Camera, pixel: IVec2) -> Option<PixelHit> {
    let ray = camera.ray(pixel.as_vec2() + 0.5);
    let hit = scene.intersect(&ray)?;
    let normal = scene.normals[hit.triangle as usize];
    let is_back = normal.dot(ray.direction) > 0.0;
    let point = scene.point(&hit);
    Some(PixelHit {
        point,
        normal: if is_back { -normal } else { normal },
        object: scene.object_of[hit.triangle as usize],
        distance: (point - camera.center).length(),
    })
}
