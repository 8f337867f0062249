//! Compares estimated with true albedo, pixel by pixel.

use crate::capture::truth::Truth;
use crate::capture::{Capture, Frame};
use crate::error::Result;
use crate::inverse::estimate::Estimate;
use crate::scene::camera::Camera;
use crate::scene::{Object, Scene};
use crate::transport::material::Material;
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Points along a pixel's side at which the estimate is sampled; the truth is box-filtered in the same way.
const SIDE: u32 = 4;

/// Squared errors pooled over frames.
#[derive(Debug, Clone, Default)]
pub struct PictureErrors {
    squares: f64,
    values: u64,
    /// For each object: number of compared pixels, sum of the true albedo, and sum of its squared length.
    objects: Vec<(u64, DVec3, f64)>,
}

impl PictureErrors {
    /// Peak signal-to-noise ratio in dB with peak 1. `None` without true pictures or without any error.
    pub fn psnr(&self) -> Option<f64> {
        decibel(self.squares, self.values)
    }

    /// The same for the best estimate of one colour per object: the mean of its true albedo.
    pub fn psnr_constant_per_object(&self) -> Option<f64> {
        let squares = self
            .objects
            .iter()
            .filter(|(pixels, ..)| *pixels > 0)
            .map(|(pixels, sum, squares)| squares - sum.length_squared() / *pixels as f64)
            .sum::<f64>();
        decibel(squares.max(0.0), self.values)
    }
}

/// Peak signal-to-noise ratio in dB with peak 1; `None` without values or without any error.
fn decibel(squares: f64, values: u64) -> Option<f64> {
    (values > 0 && squares > 0.0).then(|| -10.0 * (squares / values as f64).log10())
}

/// Compares estimated and true albedo in all frames. `true_albedo` returns a frame's true albedo by rows, or `None` if it has none.
///
/// # Errors
/// As `true_albedo`.
pub fn compare(
    capture: &Capture,
    scene: &Scene,
    estimate: &Estimate,
    truth: &Truth,
    true_albedo: impl Fn(usize, &Frame) -> Result<Option<Vec<Vec3>>>,
) -> Result<PictureErrors> {
    let materials = estimate.materials();
    let emits = |o: &Object| (truth.objects.get(&o.name)).is_some_and(|t| t.is_emitter());
    let emitters: Vec<bool> = scene.objects.iter().map(emits).collect();
    let mut errors = PictureErrors {
        objects: vec![(0, DVec3::ZERO, 0.0); scene.objects.len()],
        ..PictureErrors::default()
    };
    for (index, frame) in capture.frames.iter().enumerate() {
        let Some(known) = true_albedo(index, frame)? else {
            continue;
        };
        let camera = Camera::new(&frame.intrinsics, &frame.pose, scene.origin);
        let found = albedos(scene, &camera, &materials, &emitters);
        let both = found.into_iter().zip(known);
        for ((object, albedo), known) in both.filter_map(|(found, known)| Some((found?, known))) {
            let known = known.as_dvec3();
            errors.squares += (albedo.as_dvec3() - known).length_squared();
            errors.values += 3;
            let (pixels, sum, squares) = &mut errors.objects[object];
            *pixels += 1;
            *sum += known;
            *squares += known.length_squared();
        }
    }
    Ok(errors)
}

/// For each object, the number of pixels of all photographs whose centre sees it.
pub fn seen_pixels(capture: &Capture, scene: &Scene) -> Vec<u64> {
    let mut seen = vec![0; scene.objects.len()];
    for frame in &capture.frames {
        let camera = Camera::new(&frame.intrinsics, &frame.pose, scene.origin);
        for triangle in scene.seen_by(&camera) {
            if let Some(&object) = scene.object_of.get(triangle as usize) {
                seen[object as usize] += 1;
            }
        }
    }
    seen
}

/// The object at the centre of every pixel and the pixel's mean albedo; `None` if part of it sees an emitter or no surface.
fn albedos(
    scene: &Scene,
    camera: &Camera,
    materials: &[Material],
    emitters: &[bool],
) -> Vec<Option<(usize, Vec3)>> {
    let at = |point: Vec2| {
        let hit = scene.intersect(&camera.ray(point))?;
        Some((scene.object_of[hit.triangle as usize] as usize, hit))
    };
    let albedo = |corner: Vec2| {
        let mut sum = Vec3::ZERO;
        for i in 0..SIDE * SIDE {
            let offset = |i: u32| (i as f32 + 0.5) / SIDE as f32;
            let (object, hit) = at(corner + Vec2::new(offset(i % SIDE), offset(i / SIDE)))?;
            if emitters[object] {
                return None;
            }
            sum += materials.get(object)?.albedo_at(&hit);
        }
        Some(sum / (SIDE * SIDE) as f32)
    };
    (0..camera.pixels())
        .into_par_iter()
        .map(|pixel| {
            let corner = camera.corner(pixel);
            let (object, _) = at(corner + 0.5)?;
            Some((object, albedo(corner)?))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_error_is_twenty_decibel_and_the_best_constant_is_the_mean() {
        let known = [0.2, 0.4];
        let objects = vec![(
            2,
            DVec3::splat(0.6),
            3.0 * known.iter().map(|v| v * v).sum::<f64>(),
        )];
        let errors = PictureErrors {
            squares: 6.0 * 0.01,
            values: 6,
            objects,
        };
        for found in [errors.psnr(), errors.psnr_constant_per_object()] {
            assert!(found.is_some_and(|d| (d - 20.0).abs() < 1e-9), "{found:?}");
        }
        assert_eq!(PictureErrors::default().psnr(), None);
    }
}
