//! The baseline of augmented reality without a reconstruction: an object lit by nine spherical harmonics, pasted over the
//! photograph with a depth test. It casts no shadow and takes no part in interreflection.

use crate::capture::exposure::Exposure;
use crate::compose::backdrop::Backdrop;
use crate::compose::placement::PlacedObject;
use crate::compose::world::FurnishedScene;
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::math::sh::Harmonics;
use crate::math::warp;
use crate::scene::camera::Camera;
use crate::scene::geometry::Ray;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, radiance};
use crate::transport::world::World;
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

/// Columns and rows of the panorama that photographs are projected onto.
const PANORAMA: (usize, usize) = (64, 32);
/// Most pixels read along each side of a photograph.
const MAX_PIXELS_A_SIDE: u32 = 256;
/// Rows and columns of the stratified directions of a light probe.
const PROBE_SIDE: usize = 64;
/// Sub-pixels along a side, for coverage.
const GRID: usize = 4;

/// Spherical harmonics of the photographs, as if all light came from far away. Directions that none shows get the others' mean.
pub fn harmonics_of_photographs<'a>(
    frames: impl IntoIterator<Item = (&'a Camera, &'a Picture)>,
) -> Harmonics {
    let (columns, rows) = PANORAMA;
    let mut cells = vec![(DVec3::ZERO, 0u32); columns * rows];
    for (camera, picture) in frames {
        let stride = |length: u32| length.div_ceil(MAX_PIXELS_A_SIDE).max(1) as usize;
        for y in (0..picture.height).step_by(stride(picture.height)) {
            for x in (0..picture.width).step_by(stride(picture.width)) {
                let color = picture.pixels[(y * picture.width + x) as usize];
                if !color.is_finite() {
                    continue;
                }
                let d = camera.ray(Vec2::new(x as f32, y as f32) + 0.5).direction;
                // Bands of equal height on a sphere have equal solid angle.
                let row = ((d.z + 1.0) * 0.5 * rows as f32) as usize;
                let turn = (d.y.atan2(d.x) / (2.0 * PI)).rem_euclid(1.0);
                let column = (turn * columns as f32) as usize;
                let cell = &mut cells[row.min(rows - 1) * columns + column.min(columns - 1)];
                cell.0 += color.as_dvec3();
                cell.1 += 1;
            }
        }
    }
    let mean = |(sum, n): &(DVec3, u32)| (*n > 0).then(|| *sum / f64::from(*n));
    let means: Vec<Option<DVec3>> = cells.iter().map(mean).collect();
    let seen = means.iter().flatten().count().max(1) as f64;
    let mean = means.iter().flatten().sum::<DVec3>() / seen;

    let mut harmonics = Harmonics::default();
    let solid_angle = 4.0 * std::f64::consts::PI / means.len() as f64;
    for (index, color) in means.iter().enumerate() {
        let u = [
            1.0 - ((index / columns) as f32 + 0.5) / rows as f32,
            ((index % columns) as f32 + 0.5) / columns as f32,
        ];
        let color = color.unwrap_or(mean).as_vec3();
        harmonics.add(warp::uniform_sphere(u), color, solid_angle);
    }
    harmonics
}

/// Spherical harmonics of the radiance that arrives at a point of the estimated scene, by path tracing.
pub fn harmonics_of_estimate(
    lit: &LitScene,
    point: Vec3,
    options: &PathOptions,
    seed: u64,
) -> Harmonics {
    let count = PROBE_SIDE * PROBE_SIDE;
    let arriving = |index: usize| {
        let mut stream = Stream::new(seed, 0, index as u64, 0);
        let [du, dv] = stream.uniform2();
        let u = [
            ((index / PROBE_SIDE) as f32 + du) / PROBE_SIDE as f32,
            ((index % PROBE_SIDE) as f32 + dv) / PROBE_SIDE as f32,
        ];
        let ray = Ray::new(point, warp::uniform_sphere(u));
        let sample = radiance(lit, &ray, &mut stream, options);
        (ray.direction, sample.radiance)
    };
    let found: Vec<(Vec3, Vec3)> = (0..count).into_par_iter().map(arriving).collect();
    let mut harmonics = Harmonics::default();
    for (direction, color) in found {
        harmonics.add(direction, color, 4.0 * std::f64::consts::PI / count as f64);
    }
    harmonics
}

/// Naively lit objects, ready to be pasted over a photograph.
#[derive(Debug, Clone)]
pub struct Pasted {
    /// Covered pixels: index, the objects' light in the photograph's values times coverage, and coverage.
    covered: Vec<(usize, Vec3, f32)>,
    saturation: Vec3,
}

impl Pasted {
    /// Shades objects in front of a backdrop, each by its own harmonics. `exposure` maps their light to the
    /// photograph's values: identity for harmonics of photographs, the backdrop's for harmonics of the estimate.
    pub fn new(
        backdrop: &Backdrop,
        lit: &LitScene,
        objects: &[Arc<PlacedObject>],
        harmonics: &[Harmonics],
        exposure: Exposure,
    ) -> Self {
        let width = backdrop.photograph.width as usize;
        let world = FurnishedScene::new(lit, objects);
        let first = lit.scene.objects.len() as u32;
        let lens = &backdrop.camera.intrinsics;
        let pixel_angle = (1.0 / lens.fx.abs().min(lens.fy.abs())) as f32;
        let covered = |pixel: usize| {
            let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
            let middle = backdrop.camera.ray(corner + 0.5);
            if !objects.iter().any(|o| o.is_near(&middle, pixel_angle)) {
                return None;
            }
            let (mut covered, mut sum) = (0, Vec3::ZERO);
            for cell in 0..GRID * GRID {
                let inside = Vec2::new((cell % GRID) as f32, (cell / GRID) as f32) + 0.5;
                let ray = backdrop.camera.ray(corner + inside / GRID as f32);
                let seen = world.intersect(&ray).filter(|s| s.object >= first);
                let light =
                    seen.and_then(|s| Some((s, harmonics.get((s.object - first) as usize)?)));
                if let Some((surface, harmonics)) = light {
                    let normal = match surface.normal.dot(ray.direction) > 0.0 {
                        true => -surface.shading_normal,
                        false => surface.shading_normal,
                    };
                    // Nine harmonics cannot represent gloss: specular reflectance is treated as diffuse.
                    let specular = surface.lobe.map_or(Vec3::ZERO, |lobe| lobe.specular);
                    let reflectance = specular + surface.albedo * (Vec3::ONE - specular);
                    sum += reflectance * harmonics.irradiance(normal) * FRAC_1_PI;
                    covered += 1;
                }
            }
            let cells = (GRID * GRID) as f32;
            let size = [backdrop.photograph.width, backdrop.photograph.height];
            (covered > 0).then(|| {
                let light = sum / covered as f32 * exposure.at(lens, size, pixel);
                let alpha = covered as f32 / cells;
                let value = exposure.value(light, backdrop.saturation);
                (pixel, value * alpha, alpha)
            })
        };
        let pixels = (0..backdrop.photograph.pixels.len()).into_par_iter();
        Self {
            covered: pixels.filter_map(covered).collect(),
            saturation: backdrop.saturation,
        }
    }

    /// The photograph with the objects pasted over it.
    pub fn over(&self, photograph: &Picture) -> Picture {
        let mut picture = photograph.clone();
        for &(pixel, light, alpha) in &self.covered {
            let pasted = light + photograph.pixels[pixel] * (1.0 - alpha);
            picture.pixels[pixel] = pasted.min(self.saturation);
        }
        picture
    }
}
