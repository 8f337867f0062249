//! Points of photographs that can be found again: structure in both directions, on one surface.

use crate::capture::poses::matches::RADIUS;
use crate::capture::poses::picture::Picture;
use crate::math::stats::quantile;
use glam::{DVec2, DVec3, Vec3Swizzles};
use nalgebra::{Matrix3, Vector3};

/// About so many points a photograph: one in each cell of a grid.
const CELLS: usize = 400;
/// A patch's depths may differ from a plane by this part, root mean square; more is an edge between surfaces.
const MAX_BEND: f64 = 0.02;
/// Samples of depth along each side of a patch.
const DEPTHS: i32 = 7;
/// Part of them that must be measured.
const MIN_MEASURED: f64 = 0.7;
/// A point has so many times the structure of noise, at least. With 5, noise of a dim, plain room passes for points.
const MIN_STRUCTURE: f32 = 20.0;
/// Structure of noise: what this part of a photograph's pixels falls short of. Walls between details are flat.
const FLAT: f64 = 0.1;
/// Every so many pixels along each side are looked at for it.
const STRIDE: usize = 4;

/// A point on a surface, seen at a pixel of the photograph that it was found in.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    pub frame: usize,
    /// Column and row.
    pub pixel: [usize; 2],
    /// Its undistorted normalised coordinates.
    pub ray: DVec2,
    /// Inverse depth there in 1/m, and its slopes along the normalised coordinates: exact for a plane.
    pub inverse_depth: DVec3,
}

impl Point {
    /// The point of its plane at normalised coordinates near its own, in camera coordinates: x right, y down, z forwards.
    pub fn on_plane(&self, ray: DVec2) -> Option<DVec3> {
        let inverse = self.inverse_depth.x + self.inverse_depth.yz().dot(ray - self.ray);
        (inverse > 0.0).then(|| ray.extend(1.0) / inverse)
    }
}

/// The points of one photograph, at most one in each cell, row by row.
pub fn find(frame: usize, picture: &Picture) -> Vec<Point> {
    let grey = &picture.fine;
    let (width, height) = (grey.width, grey.height);
    let side = (((width * height) as f64 / CELLS as f64).sqrt().ceil() as usize).max(1);
    let margin = RADIUS + 2;
    if width <= 2 * margin || height <= 2 * margin {
        return Vec::new();
    }
    let cells =
        (0..height.div_ceil(side)).flat_map(|j| (0..width.div_ceil(side)).map(move |i| [i, j]));
    let best: Vec<(f32, [usize; 2])> = cells
        .filter_map(|[i, j]| {
            let columns = (i * side).max(margin)..((i + 1) * side).min(width - margin);
            let rows = (j * side).max(margin)..((j + 1) * side).min(height - margin);
            rows.flat_map(|y| columns.clone().map(move |x| [x, y]))
                .map(|[x, y]| (structure(picture, x, y), [x, y]))
                .max_by(|a, b| a.0.total_cmp(&b.0))
        })
        .collect();
    let mut structures: Vec<f64> = (margin..height - margin)
        .step_by(STRIDE)
        .flat_map(|y| {
            (margin..width - margin)
                .step_by(STRIDE)
                .map(move |x| [x, y])
        })
        .map(|[x, y]| f64::from(structure(picture, x, y)))
        .collect();
    let noise = quantile(&mut structures, FLAT).unwrap_or(0.0) as f32;
    (best.iter())
        .filter(|(structure, _)| *structure > MIN_STRUCTURE * noise)
        .filter_map(|(_, pixel)| on_a_surface(frame, picture, *pixel))
        .collect()
}

/// Mean squared gradient around a pixel in the weaker direction (Shi and Tomasi 1994).
fn structure(picture: &Picture, x: usize, y: usize) -> f32 {
    const HALF: usize = 3;
    let [mut xx, mut xy, mut yy] = [0.0_f32; 3];
    for j in y - HALF..=y + HALF {
        for i in x - HALF..=x + HALF {
            let [u, v] = picture.fine.gradient(i, j);
            xx += u * u;
            xy += u * v;
            yy += v * v;
        }
    }
    let count = ((2 * HALF + 1) * (2 * HALF + 1)) as f32;
    let half = 0.5 * (xx + yy);
    (half - (0.25 * (xx - yy).powi(2) + xy * xy).sqrt()) / count
}

/// The point at a pixel; `None` where its patch is clipped, lacks depth or spans two surfaces.
fn on_a_surface(frame: usize, picture: &Picture, pixel: [usize; 2]) -> Option<Point> {
    let center = DVec2::new(pixel[0] as f64 + 0.5, pixel[1] as f64 + 0.5);
    if !picture.is_clear(center, RADIUS) {
        return None;
    }
    let ray = picture.lens.ray(center)?;
    let half = DEPTHS / 2;
    let step = RADIUS as f64 / f64::from(half);
    let samples: Vec<(DVec2, f64)> = (-half..=half)
        .flat_map(|j| (-half..=half).map(move |i| DVec2::new(f64::from(i), f64::from(j))))
        .filter_map(|offset| {
            let sample = picture.lens.ray(center + offset * step)?;
            Some((sample - ray, 1.0 / picture.depth_along(sample)?))
        })
        .collect();
    if (samples.len() as f64) < MIN_MEASURED * f64::from(DEPTHS * DEPTHS) {
        return None;
    }

    // The plane by least squares.
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (offset, inverse) in &samples {
        let row = Vector3::new(1.0, offset.x, offset.y);
        matrix += row * row.transpose();
        right += row * *inverse;
    }
    let plane = matrix.cholesky()?.solve(&right);
    let bend = |(offset, inverse): &(DVec2, f64)| {
        let fitted = plane.x + plane.y * offset.x + plane.z * offset.y;
        (fitted / inverse - 1.0).powi(2)
    };
    let bend = samples.iter().map(bend).sum::<f64>() / samples.len() as f64;
    (plane.x > 0.0 && bend.sqrt() <= MAX_BEND).then(|| Point {
        frame,
        pixel,
        ray,
        inverse_depth: DVec3::new(plane.x, plane.y, plane.z),
    })
}
