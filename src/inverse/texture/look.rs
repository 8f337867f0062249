//! Where the parts of each pixel of an object land on its triangles.

use crate::calibrate::gbuffer::GBufferPixel;
use crate::calibrate::problem::Problem;
use crate::calibrate::sharpness::Sharpness;
use crate::math::rng::{Stream, splitmix64};
use crate::scene::geometry::Hit;
use crate::transport::bsdf::base_by_view;
use crate::transport::lit::Lit;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Rays along a pixel's side.
const SIDE: u32 = 4;
/// Rays through a pixel.
pub const RAYS: u32 = SIDE * SIDE;
/// First of the sample keys of these rays, far from those of paths.
const KEY: u64 = 3 << 60;
/// Of the pixels in the fit, or of the photographs under a lobe, one in so many is left out in turn.
pub const FOLDS: usize = 5;
/// Key of the choice.
const FOLD_KEY: u64 = 0x51f0_1d5e;

/// A pixel that sees one smooth surface of one object, through which rays were cast.
#[derive(Debug, Clone)]
pub struct SeenPixel {
    /// Frame index.
    pub frame: u32,
    /// Row by row from the top left.
    pub pixel: u32,
    /// Whether it is kept out of every fit.
    pub held_out: bool,
    /// What the photograph holds.
    pub measured: Vec3,
    /// Whether that is saturated: the surface sends so much at least.
    pub saturated: bool,
    /// Which of the [`FOLDS`] it belongs to.
    pub fold: usize,
    /// How much it says beside a pixel of a photograph of the usual sharpness.
    pub weight: f32,
    /// What the base of the surface sends in this direction over what it sends along its normal; 1 without a lobe.
    pub base: f32,
    /// Radiance that its lobe sends here, where that was found.
    pub gloss: Vec3,
    /// Where its rays land.
    pub landings: Vec<Landing>,
}

/// Where one ray through a pixel meets the object.
#[derive(Debug, Clone, Copy)]
pub struct Landing {
    /// The place on its triangle.
    pub hit: Hit,
    /// Whether it meets the triangle's front.
    pub front: bool,
    /// Width of the pixel's footprint there: the root of its area, in metres.
    pub footprint: f32,
    /// Cosine of the angle between the normal on that side and the ray.
    pub cosine: f32,
}

impl Landing {
    /// The normal on the side that is met.
    pub fn normal(&self, lit: &Lit) -> Vec3 {
        let normal = lit.scene.normals[self.hit.triangle as usize];
        if self.front { normal } else { -normal }
    }
}

/// Looks through the given pixels, all of which see `object`; those that also see something else are left out.
///
/// Where it is `glossy`, folds are whole photographs, those next to each other together: a highlight that was taken for
/// texture is elsewhere in the photographs left out.
pub fn look(
    problem: &Problem,
    object: u32,
    pixels: &[&GBufferPixel],
    sharpness: &Sharpness,
    glossy: bool,
    seed: u64,
) -> Vec<SeenPixel> {
    let seen: Vec<Option<SeenPixel>> = pixels
        .par_iter()
        .map(|pixel| look_through(problem, object, pixel, sharpness, seed))
        .collect();
    let mut seen: Vec<SeenPixel> = seen.into_iter().flatten().collect();
    if glossy {
        let mut frames: Vec<u32> = seen.iter().map(|p| p.frame).collect();
        frames.sort_unstable();
        frames.dedup();
        for pixel in &mut seen {
            let before = frames.partition_point(|&frame| frame < pixel.frame);
            pixel.fold = before * FOLDS / frames.len();
            let sum: f32 = (pixel.landings.iter())
                .map(|l| base_by_view(l.cosine))
                .sum();
            pixel.base = sum / pixel.landings.len() as f32;
        }
    }
    seen
}

fn look_through(
    problem: &Problem,
    object: u32,
    pixels_of_frame: &GBufferPixel,
    sharpness: &Sharpness,
    seed: u64,
) -> Option<SeenPixel> {
    let scene = &*problem.scene;
    let photograph = &problem.photographs[pixels_of_frame.frame as usize];
    let measured = photograph.pixels[pixels_of_frame.pixel as usize];
    let camera = &scene.cameras[pixels_of_frame.frame as usize];
    let corner = Vec2::new(
        (pixels_of_frame.pixel % photograph.width) as f32,
        (pixels_of_frame.pixel / photograph.width) as f32,
    );
    let focal2 = (camera.intrinsics.fx * camera.intrinsics.fy) as f32;
    let mut stream = Stream::new(
        seed,
        u64::from(pixels_of_frame.frame),
        u64::from(pixels_of_frame.pixel),
        KEY,
    );
    let mut landings = Vec::with_capacity(RAYS as usize);
    for i in 0..RAYS {
        let [dx, dy] = stream.uniform2();
        let offset = Vec2::new((i % SIDE) as f32 + dx, (i / SIDE) as f32 + dy) / SIDE as f32;
        let hit = scene.intersect(&camera.ray(corner + offset))?;
        if scene.object_of[hit.triangle as usize] != object {
            return None;
        }
        let to_camera = camera.center - scene.point(&hit);
        let cosine = scene.normals[hit.triangle as usize].dot(to_camera.normalize_or_zero());
        landings.push(Landing {
            hit,
            front: cosine >= 0.0,
            footprint: (to_camera.length_squared() / (focal2 * cosine.abs().max(0.05))).sqrt(),
            cosine: cosine.abs(),
        });
    }
    Some(SeenPixel {
        frame: pixels_of_frame.frame,
        pixel: pixels_of_frame.pixel,
        held_out: pixels_of_frame.held_out,
        measured,
        saturated: photograph.is_saturated(pixels_of_frame.pixel as usize),
        fold: fold(pixels_of_frame.frame, pixels_of_frame.pixel),
        weight: sharpness.weight(pixels_of_frame.frame as usize),
        base: 1.0,
        gloss: Vec3::ZERO,
        landings,
    })
}

/// The fold that a pixel belongs to by chance.
fn fold(frame: u32, pixel: u32) -> usize {
    let key = splitmix64(splitmix64(u64::from(frame) ^ FOLD_KEY) ^ u64::from(pixel));
    (key % FOLDS as u64) as usize
}
