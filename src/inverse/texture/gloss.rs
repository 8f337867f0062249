//! Traces the radiance of a textured surface: of its base with unit albedo, and of the lobe above it.

use crate::inverse::texture::look::SeenPixel;
use crate::math::frame::Frame;
use crate::math::rng::Stream;
use crate::transport::arrival::{RayCount, arrivals};
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, white_radiance};
use crate::transport::world::SurfacePoint;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// First of the sample keys of these paths, disjoint from those of other stages.
const KEY: u64 = 11 << 59;

/// Radiance of the base along `normal` with an albedo of one, estimated by one or two paths; irradiance / π without a lobe.
pub fn white_base(
    lit: &LitScene,
    surface: &SurfacePoint,
    normal: Vec3,
    stream: &mut Stream,
    options: &PathOptions,
) -> (Vec3, RayCount) {
    let Some(lobe) = surface.lobe else {
        let path = white_radiance(lit, surface, normal, stream, options);
        let cast = RayCount {
            rays: u64::from(path.rays),
            rejected: u64::from(path.rejected),
        };
        return (path.radiance, cast);
    };
    let frame = Frame::around(normal);
    let mut incident = Vec::new();
    let cast = arrivals(
        lit,
        surface,
        &frame,
        Vec3::Z,
        &[],
        stream,
        options,
        &mut incident,
    );
    let light = (incident.iter()).map(|a| a.light.as_dvec3() * lobe.base(Vec3::Z, a.wi));
    (light.sum::<DVec3>().as_vec3(), cast)
}

/// Radiance of the lobe towards the camera at one of a pixel's hits (`index` modulo their number), estimated by a few paths;
/// zero without a lobe.
pub fn gloss(
    lit: &LitScene,
    pixel: &SeenPixel,
    index: usize,
    stream: &mut Stream,
    options: &PathOptions,
) -> (Vec3, RayCount) {
    let hit = &pixel.hits[index % pixel.hits.len()];
    let surface = lit.surface(&hit.hit);
    let Some(lobe) = surface.lobe else {
        return (Vec3::ZERO, RayCount::default());
    };
    let camera = &lit.scene.cameras[pixel.frame as usize];
    let frame = Frame::around(hit.normal(lit));
    let wo = frame.to_local((camera.center - surface.point).normalize_or_zero());
    if wo.z <= 0.0 {
        return (Vec3::ZERO, RayCount::default());
    }
    let mut incident = Vec::new();
    let drawn = [f64::from(lobe.roughness)];
    let cast = arrivals(
        lit,
        &surface,
        &frame,
        wo,
        &drawn,
        stream,
        options,
        &mut incident,
    );
    let light = (incident.iter()).map(|a| a.light.as_dvec3() * lobe.reflected(wo, a.wi));
    (light.sum::<DVec3>().as_vec3(), cast)
}

/// Sets the gloss of each pixel in the fit, from `samples` paths each.
pub fn trace_gloss(
    lit: &LitScene,
    pixels: &mut [SeenPixel],
    samples: u32,
    options: &PathOptions,
    seed: u64,
    key: u64,
) -> RayCount {
    (pixels.par_iter_mut().filter(|pixel| !pixel.held_out))
        .map(|pixel| {
            let (mut sum, mut cast) = (DVec3::ZERO, RayCount::default());
            for sample in 0..samples {
                let pixel_key = (u64::from(pixel.frame) << 32) + u64::from(pixel.pixel);
                let mut stream = Stream::new(seed, key, pixel_key, KEY + u64::from(sample));
                let (light, own_cast) = gloss(lit, pixel, sample as usize, &mut stream, options);
                sum += light.as_dvec3();
                cast += own_cast;
            }
            pixel.gloss = (sum / f64::from(samples.max(1))).as_vec3();
            cast
        })
        .sum()
}
