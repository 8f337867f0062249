//! Masks pixels whose measured depth contradicts the mesh: what they show is missing from the mesh or elsewhere in it.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::scan::depth::decode;
use crate::error::{Error, Result};
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::visibility::NOTHING;
use glam::Vec2;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// A pixel contradicts the mesh if the difference exceeds [`MEDIANS`] × the frame's median difference + [`DEPTH_FRACTION`] × depth.
const MEDIANS: f64 = 5.0;
const DEPTH_FRACTION: f64 = 0.02;
/// Relative tolerance of the aspect ratio between a depth image and its photograph.
const ASPECT_TOLERANCE: f64 = 0.02;

/// Compares the depth images of a capture with its mesh. Returns the photographs with contradicting pixels marked unusable, one per
/// camera, and warnings, full sentences. Frames without a readable depth image keep all pixels; unreadable ones give a warning.
pub fn compare(
    capture: &Capture,
    scene: &Scene,
    photographs: &[Arc<Photograph>],
) -> (Vec<Arc<Photograph>>, Vec<String>) {
    let outcomes: Vec<Option<Result<(Photograph, u64)>>> = (0..photographs.len())
        .into_par_iter()
        .map(|frame| {
            let (path, unit) = capture.frames[frame].depth.as_ref()?;
            Some(mask(path, *unit, scene, frame, &photographs[frame]))
        })
        .collect();
    let read = outcomes.iter().flatten().count();

    let mut warnings = Vec::new();
    let (mut contradicting, mut compared) = (0, 0);
    let mut refused = Vec::new();
    let mut photographs = photographs.to_vec();
    for (photograph, outcome) in photographs.iter_mut().zip(outcomes) {
        match outcome {
            Some(Ok((masked, count))) => {
                contradicting += count;
                compared += masked.pixels.len() as u64;
                *photograph = Arc::new(masked);
            }
            Some(Err(error)) => refused.push(error),
            None => {}
        }
    }
    if let Some(first) = refused.first() {
        warnings.push(format!(
            "{} of {read} depth images are not compared with the mesh: {first}",
            refused.len(),
        ));
    }
    if contradicting > 0 {
        warnings.push(format!(
            "{:.0} % of the pixels with a depth image contradict the mesh by it and are left out",
            contradicting as f64 / compared as f64 * 100.0
        ));
    }
    (photographs, warnings)
}

/// Marks the pixels that contradict the mesh by a depth image as unusable; also returns their number.
fn mask(
    path: &Path,
    unit: f64,
    scene: &Scene,
    frame: usize,
    photograph: &Photograph,
) -> Result<(Photograph, u64)> {
    let image = decode(path)?;
    let (width, height) = image.dimensions();
    let aspect = |width: u32, height: u32| f64::from(width) / f64::from(height.max(1));
    let ratio = aspect(width, height) / aspect(photograph.width, photograph.height);
    let matches = width > 0 && height > 0 && (ratio - 1.0).abs() < ASPECT_TOLERANCE;
    if !matches {
        let problem = "has another aspect ratio than its photograph";
        return Err(Error::file(path, problem, "its pixels are not compared"));
    }
    let size = Vec2::new(photograph.width as f32, photograph.height as f32);
    let camera = &scene.cameras[frame];
    let triangles = &scene.ids().triangles[frame];
    let pixels: Vec<Option<(f64, f64)>> = (triangles.iter().enumerate())
        .map(|(pixel, &triangle)| {
            let at = camera.corner(pixel) + 0.5;
            let fraction = at / size;
            let x = ((fraction.x * width as f32) as u32).min(width - 1);
            let y = ((fraction.y * height as f32) as u32).min(height - 1);
            let [value] = image.get_pixel(x, y).0;
            let measured = (value > 0).then(|| f64::from(value) * unit)?;
            Some((measured, mesh_depth(scene, camera, at, triangle)))
        })
        .collect();
    let mut differences: Vec<f64> = (pixels.iter().flatten())
        .map(|(measured, mesh)| (measured - mesh).abs())
        .filter(|d| d.is_finite())
        .collect();
    let median = quantile(&mut differences, 0.5).unwrap_or(0.0);

    let mut masked = photograph.clone();
    masked.usable.resize(masked.pixels.len(), true);
    let mut count = 0;
    for (usable, seen) in masked.usable.iter_mut().zip(&pixels) {
        let contradicts = seen.is_some_and(|(measured, mesh)| {
            (measured - mesh).abs() > MEDIANS * median + DEPTH_FRACTION * measured
        });
        count += u64::from(contradicts);
        *usable &= !contradicts;
    }
    Ok((masked, count))
}

/// Depth in metres along the optical axis of a triangle's plane; infinite for [`NOTHING`].
fn mesh_depth(scene: &Scene, camera: &Camera, at: Vec2, triangle: u32) -> f64 {
    if triangle == NOTHING {
        return f64::INFINITY;
    }
    let ray = camera.ray(at);
    let along = scene.plane_distance(triangle, &ray);
    f64::from(along * ray.direction.dot(camera.forward()))
}
