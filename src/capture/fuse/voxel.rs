//! Chooses the voxel size.

use crate::capture::fuse::MAX_BYTES;
use crate::capture::scan::{DepthImage, ImportedFrame};
use crate::error::{Error, Result};
use crate::math::stats::quantile;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Default number of voxels along the scan's longest side.
const ACROSS: f64 = 256.0;
/// Depth images sampled for the scan's extent.
const FRAMES: usize = 64;
/// Points sampled along the longer side of each depth image.
const POINTS: u32 = 64;

/// The edge that the person gives, or 1/256 of the longest side of the measured points' bounding box (from their 1 % to their
/// 99 % quantiles), but at least the median size of a depth pixel on the surfaces. A room that fills its bounding box with
/// surfaces then needs 400 MB. Also returns a remark on it.
///
/// # Errors
/// The given edge is not positive, a depth image is broken, or no depth was measured.
pub fn voxel_size(frames: &[ImportedFrame], given: Option<f64>) -> Result<(f64, String)> {
    if let Some(edge) = given {
        if !(edge.is_finite() && edge > 0.0) {
            return Err(Error::usage(
                "--voxel",
                "the edge of a voxel must be positive",
                "give it in metres, e.g. 0.02",
            ));
        }
        return Ok((edge, format!("voxels of {edge} m")));
    }
    let with_depth: Vec<(&ImportedFrame, &DepthImage)> = frames
        .iter()
        .filter_map(|frame| Some((frame, frame.depth.as_ref()?)))
        .collect();
    let step = with_depth.len().div_ceil(FRAMES).max(1);
    let samples: Result<Vec<Vec<(DVec3, f64)>>> = with_depth
        .par_iter()
        .step_by(step)
        .map(|(frame, depth)| points(frame, depth))
        .collect();
    let samples: Vec<(DVec3, f64)> = samples?.into_iter().flatten().collect();
    let ends = |value: fn(&DVec3) -> f64| -> Option<(f64, f64)> {
        let mut values: Vec<f64> = samples.iter().map(|(p, _)| value(p)).collect();
        Some((quantile(&mut values, 0.01)?, quantile(&mut values, 0.99)?))
    };
    let sides = [ends(|p| p.x), ends(|p| p.y), ends(|p| p.z)];
    let longest = sides
        .iter()
        .flatten()
        .fold(0.0, |longest: f64, (low, high)| longest.max(high - low));
    let mut pixels: Vec<f64> = samples.iter().map(|(_, pixel)| *pixel).collect();
    let Some(pixel) = quantile(&mut pixels, 0.5).filter(|_| longest > 0.0) else {
        return Err(Error::new(
            "depth images",
            "they hold no measured depth",
            "check the depth images, or name a mesh with --mesh",
        ));
    };

    let reason = match pixel > longest / ACROSS {
        true => "the size of a depth pixel".to_owned(),
        false => format!("1/{ACROSS} of the depth's extent of {longest:.2} m"),
    };
    let edge = pixel.max(longest / ACROSS);
    let most = MAX_BYTES >> 30;
    let remark =
        format!("voxels of {edge:.4} m: {reason} (at most {most} GiB of them; --voxel overrides)");
    Ok((edge, remark))
}

/// Measured points of a depth image in the world, each with the size of a pixel at its depth, in metres.
fn points(frame: &ImportedFrame, depth: &DepthImage) -> Result<Vec<(DVec3, f64)>> {
    let metres = depth.metres()?;
    let k = &depth.lens.pinhole;
    let stride = k.width.max(k.height).div_ceil(POINTS).max(1) as usize;
    let mut points = Vec::new();
    for y in (0..k.height).step_by(stride) {
        for x in (0..k.width).step_by(stride) {
            let z = f64::from(metres[(y * k.width + x) as usize]);
            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            if z > 0.0
                && let Some(ray) = depth.lens.ray(pixel)
            {
                points.push((frame.pose.to_world(ray.extend(1.0) * z), z / k.fx));
            }
        }
    }
    Ok(points)
}
