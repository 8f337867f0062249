//! Samples the pixels of an object: where the rays through each pixel hit its triangles.

use crate::calibrate::gbuffer::GBufferPixel;
use crate::calibrate::problem::Problem;
use crate::calibrate::sharpness::Sharpness;
use crate::math::rng::{Stream, splitmix64};
use crate::scene::geometry::Hit;
use crate::transport::bsdf::base_by_view;
use crate::transport::lit::LitScene;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Rays along a pixel's side.
const SIDE: u32 = 4;
/// Rays through a pixel.
pub const RAYS: u32 = SIDE * SIDE;
/// First of the sample keys of these rays, disjoint from those of paths.
const KEY: u64 = 3 << 60;
/// Folds of the cross-validation: of pixels, or of photographs if the object is glossy.
pub const FOLDS: usize = 5;
/// Key of the assignment of pixels to folds.
const FOLD_KEY: u64 = 0x51f0_1d5e;

/// A pixel that sees one smooth surface of one object.
#[derive(Debug, Clone)]
pub struct SeenPixel {
    /// Frame index.
    pub frame: u32,
    /// Pixel index, row by row from the top left.
    pub pixel: u32,
    /// Whether it is held out of every fit.
    pub held_out: bool,
    /// Photographed radiance.
    pub measured: Vec3,
    /// Whether it is saturated, so that `measured` is a lower bound.
    pub saturated: bool,
    /// Its fold, below [`FOLDS`].
    pub fold: usize,
    /// Weight by the sharpness of its photograph, see [`Sharpness::weight`].
    pub weight: f32,
    /// Radiance of the surface's base towards the camera over that along the normal; 1 without a lobe.
    pub base: f32,
    /// Radiance of the lobe towards the camera; zero until it is traced.
    pub gloss: Vec3,
    /// Hits of its rays.
    pub hits: Vec<PixelHit>,
}

/// The hit of one ray through a pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelHit {
    /// Triangle and barycentric position.
    pub hit: Hit,
    /// Whether it is on the triangle's front.
    pub front: bool,
    /// Square root of the area of the pixel's footprint, in metres.
    pub footprint: f32,
    /// Cosine between the normal of that side and the direction to the camera.
    pub cosine: f32,
}

impl PixelHit {
    /// The normal of the side that is hit.
    pub fn normal(&self, lit: &LitScene) -> Vec3 {
        let normal = lit.scene.normals[self.hit.triangle as usize];
        if self.front { normal } else { -normal }
    }
}

/// Casts rays through the given pixels, all of which see `object`; pixels that also see something else are left out.
///
/// If the object is `glossy`, each fold is a run of whole photographs: a highlight fitted as texture is at another place in the
/// photographs left out.
pub fn sample_pixels(
    problem: &Problem,
    object: u32,
    pixels: &[&GBufferPixel],
    sharpness: &Sharpness,
    glossy: bool,
    seed: u64,
) -> Vec<SeenPixel> {
    let seen: Vec<Option<SeenPixel>> = pixels
        .par_iter()
        .map(|pixel| sample_pixel(problem, object, pixel, sharpness, seed))
        .collect();
    let mut seen: Vec<SeenPixel> = seen.into_iter().flatten().collect();
    if glossy {
        let mut frames: Vec<u32> = seen.iter().map(|p| p.frame).collect();
        frames.sort_unstable();
        frames.dedup();
        for pixel in &mut seen {
            let before = frames.partition_point(|&frame| frame < pixel.frame);
            pixel.fold = before * FOLDS / frames.len();
            let sum: f32 = (pixel.hits.iter()).map(|l| base_by_view(l.cosine)).sum();
            pixel.base = sum / pixel.hits.len() as f32;
        }
    }
    seen
}

fn sample_pixel(
    problem: &Problem,
    object: u32,
    pixel: &GBufferPixel,
    sharpness: &Sharpness,
    seed: u64,
) -> Option<SeenPixel> {
    let scene = &*problem.scene;
    let (frame, index) = (pixel.frame as usize, pixel.pixel as usize);
    let photograph = &problem.photographs[frame];
    let camera = &scene.cameras[frame];
    let corner = Vec2::new(
        (pixel.pixel % photograph.width) as f32,
        (pixel.pixel / photograph.width) as f32,
    );
    let focal2 = (camera.intrinsics.fx * camera.intrinsics.fy) as f32;
    let mut stream = Stream::new(seed, frame as u64, index as u64, KEY);
    let mut hits = Vec::with_capacity(RAYS as usize);
    for i in 0..RAYS {
        let [dx, dy] = stream.uniform2();
        let offset = Vec2::new((i % SIDE) as f32 + dx, (i / SIDE) as f32 + dy) / SIDE as f32;
        let hit = scene.intersect(&camera.ray(corner + offset))?;
        if scene.object_of[hit.triangle as usize] != object {
            return None;
        }
        let to_camera = camera.center - scene.point(&hit);
        let cosine = scene.normals[hit.triangle as usize].dot(to_camera.normalize_or_zero());
        hits.push(PixelHit {
            hit,
            front: cosine >= 0.0,
            footprint: (to_camera.length_squared() / (focal2 * cosine.abs().max(0.05))).sqrt(),
            cosine: cosine.abs(),
        });
    }
    Some(SeenPixel {
        frame: pixel.frame,
        pixel: pixel.pixel,
        held_out: pixel.held_out,
        measured: photograph.pixels[index],
        saturated: photograph.is_saturated(index),
        fold: fold(pixel.frame, pixel.pixel),
        weight: sharpness.weight(frame),
        base: 1.0,
        gloss: Vec3::ZERO,
        hits,
    })
}

/// The fold of a pixel, by hash.
fn fold(frame: u32, pixel: u32) -> usize {
    let key = splitmix64(splitmix64(u64::from(frame) ^ FOLD_KEY) ^ u64::from(pixel));
    (key % FOLDS as u64) as usize
}
