//! Looks up points of one photograph in others: a patch, warped by the plane of its point, is shifted until it fits
//! (Lucas and Kanade 1981; inverse compositional, Baker and Matthews 2004), whatever the exposures.

use crate::capture::camera::Pose;
use crate::capture::poses::picture::{Grey, Picture};
use crate::capture::poses::points::Point;
use glam::{DMat2, DVec2};
use rayon::prelude::*;

/// A patch reaches so many pixels from its centre.
pub const RADIUS: usize = 6;
/// Standard deviation of its Gaussian weights in pixels.
const SPREAD: f64 = 4.0;
/// Photographs that the points of one are looked up in: those that see most of them.
const PARTNERS: usize = 10;
/// Fewer common points do not make a partner.
const MIN_COMMON: usize = 10;
/// A point is hidden where measured depth is smaller than its own by more than this part.
const HIDDEN: f64 = 0.05;
/// Steps of a search at most, and the step in pixels that ends it.
const STEPS: usize = 12;
const LAST_STEP: f64 = 0.01;
/// A found patch correlates at least so much with the searched one.
const MIN_CORRELATION: f64 = 0.85;
/// Range of the area that a patch may be scaled by.
const SCALES: [f64; 2] = [0.3, 3.0];
/// Standard deviation in pixels below which no match is trusted: sampling, lens and plane are not known better.
const MIN_DEVIATION: f64 = 0.05;

/// Greatest distances in pixels that a search goes, with coarse details and with fine ones.
const FAR: f64 = 12.0;
const NEAR: f64 = 4.0;

/// Where a photograph shows a point of another.
#[derive(Debug, Clone, Copy)]
pub struct Match {
    pub frame: usize,
    pub pixel: DVec2,
    /// Inverse covariance of the position in 1/px².
    pub information: DMat2,
}

/// The matches of every point, in the order of points. Points are looked for with coarse details first if they may be `far` from
/// where they are expected, as by poses that the scan gives.
pub fn look_up(
    points: &[Point],
    pictures: &[Picture],
    poses: &[Pose],
    far: bool,
) -> Vec<Vec<Match>> {
    // Points come in the order of their photographs.
    let partners: Vec<Vec<usize>> = (0..pictures.len())
        .into_par_iter()
        .map(|frame| {
            let own: Vec<&Point> = points.iter().filter(|p| p.frame == frame).collect();
            partners(frame, &own, pictures, poses)
        })
        .collect();
    (points.par_iter())
        .map(|point| {
            (partners[point.frame].iter())
                .filter_map(|&frame| look_up_one(point, frame, pictures, poses, far))
                .collect()
        })
        .collect()
}

/// The photographs that show most of a photograph's points.
fn partners(frame: usize, own: &[&Point], pictures: &[Picture], poses: &[Pose]) -> Vec<usize> {
    let mut seen: Vec<(usize, usize)> = (0..pictures.len())
        .filter(|&other| other != frame)
        .map(|other| {
            let visible = |p: &&&Point| expected(p, p.ray, other, pictures, poses).is_some();
            (own.iter().filter(visible).count(), other)
        })
        .filter(|(count, _)| *count >= MIN_COMMON)
        .collect();
    seen.sort_by_key(|&(count, other)| (std::cmp::Reverse(count), other));
    seen.truncate(PARTNERS);
    seen.iter().map(|&(_, other)| other).collect()
}

/// Where another photograph should show a point of the plane of `point`; `None` outside it and where it is hidden.
fn expected(
    point: &Point,
    ray: DVec2,
    other: usize,
    pictures: &[Picture],
    poses: &[Pose],
) -> Option<DVec2> {
    let world = poses[point.frame].to_world(point.on_plane(ray)?);
    let there = poses[other].to_camera(world);
    let pixel = pictures[other].project(there, RADIUS as f64 + 2.0)?;
    let measured = pictures[other].depth_along(there.truncate() / there.z);
    measured
        .is_none_or(|depth| depth > (1.0 - HIDDEN) * there.z)
        .then_some(pixel)
}

fn look_up_one(
    point: &Point,
    other: usize,
    pictures: &[Picture],
    poses: &[Pose],
    far: bool,
) -> Option<Match> {
    // The warp from the point's photograph to the other, linear around the point.
    let from = &pictures[point.frame];
    let center = DVec2::new(point.pixel[0] as f64 + 0.5, point.pixel[1] as f64 + 0.5);
    let at = |offset: DVec2| {
        expected(
            point,
            from.lens.ray(center + offset)?,
            other,
            pictures,
            poses,
        )
    };
    let start = at(DVec2::ZERO)?;
    let half = RADIUS as f64 / 2.0;
    let [x, y] = [DVec2::X, DVec2::Y]
        .map(|axis| Some((at(axis * half)? - at(-axis * half)?) / (2.0 * half)));
    let warp = DMat2::from_cols(x?, y?);
    if !(SCALES[0]..=SCALES[1]).contains(&warp.determinant().abs()) {
        return None;
    }

    let to = &pictures[other];
    let mut guess = start;
    if far {
        let patch = Patch::new(&from.coarse, point.pixel, 2, warp)?;
        guess = patch.find(&to.coarse, start, FAR)?.pixel;
    }
    let patch = Patch::new(&from.fine, point.pixel, 1, warp)?;
    let found = patch.find(&to.fine, guess, NEAR)?;
    let far = DVec2::new(to.fine.width as f64, to.fine.height as f64) - RADIUS as f64;
    let inside = found.pixel.min_element() >= RADIUS as f64 && found.pixel.cmplt(far).all();
    (inside && found.correlation >= MIN_CORRELATION && to.is_clear(found.pixel, RADIUS)).then_some(
        Match {
            frame: other,
            pixel: found.pixel,
            information: found.information,
        },
    )
}

/// A patch of a photograph, normalised to mean 0 and variance 1.
struct Patch {
    /// Offsets of its pixels in the other photograph.
    offsets: Vec<DVec2>,
    weights: Vec<f64>,
    values: Vec<f64>,
    /// Derivatives of the values by the position in the other photograph.
    gradients: Vec<DVec2>,
    /// Weighted sum of their outer products.
    structure: DMat2,
}

struct Found {
    pixel: DVec2,
    correlation: f64,
    information: DMat2,
}

impl Patch {
    /// The patch around a pixel, every `stride` pixels; `None` beyond the edge and where there is nothing to see.
    fn new(grey: &Grey, pixel: [usize; 2], stride: usize, warp: DMat2) -> Option<Self> {
        let radius = RADIUS as i64;
        let inside = |p: i64, size: usize| (1..size as i64 - 1).contains(&p).then_some(p as usize);
        let unwarp = warp.inverse().transpose();
        let mut patch = Self {
            offsets: Vec::new(),
            weights: Vec::new(),
            values: Vec::new(),
            gradients: Vec::new(),
            structure: DMat2::ZERO,
        };
        for j in -radius..=radius {
            for i in -radius..=radius {
                let offset = [i * stride as i64, j * stride as i64];
                let x = inside(pixel[0] as i64 + offset[0], grey.width)?;
                let y = inside(pixel[1] as i64 + offset[1], grey.height)?;
                let [u, v] = grey.gradient(x, y);
                let distance = (i * i + j * j) as f64;
                let offset = DVec2::new(offset[0] as f64, offset[1] as f64);
                let weight = (-0.5 * distance / (SPREAD * SPREAD)).exp();
                patch.weights.push(weight);
                patch.offsets.push(warp * offset);
                patch.values.push(f64::from(grey.pixel(x, y)));
                let gradient = DVec2::new(f64::from(u), f64::from(v));
                patch.gradients.push(unwarp * gradient);
            }
        }
        let total: f64 = patch.weights.iter().sum();
        patch.weights.iter_mut().for_each(|w| *w /= total);
        let deviation = normalise(&mut patch.values, &patch.weights)?;
        for (gradient, weight) in patch.gradients.iter_mut().zip(&patch.weights) {
            *gradient /= deviation;
            patch.structure += *weight * outer(*gradient);
        }
        Some(patch)
    }

    /// Shifts the patch from `start` until it fits; `None` further than `limit` pixels away, or where it does not settle.
    fn find(&self, grey: &Grey, start: DVec2, limit: f64) -> Option<Found> {
        // A little damping holds what the patch does not tell: shifts along an edge.
        let damped = self.structure + DMat2::IDENTITY * (1e-3 * trace(self.structure));
        let inverse = damped.inverse();
        let mut pixel = start;
        let mut values = vec![0.0; self.values.len()];
        for _ in 0..STEPS {
            let mut slope = DVec2::ZERO;
            for (value, offset) in values.iter_mut().zip(&self.offsets) {
                *value = f64::from(grey.at(pixel + *offset));
            }
            normalise(&mut values, &self.weights)?;
            for (index, value) in values.iter().enumerate() {
                slope += self.weights[index] * (value - self.values[index]) * self.gradients[index];
            }
            let step = inverse * slope;
            if !step.is_finite() || (pixel - step).distance(start) > limit {
                return None;
            }
            pixel -= step;
            if step.length() < LAST_STEP {
                return Some(self.found(pixel, &values));
            }
        }
        None
    }

    fn found(&self, pixel: DVec2, values: &[f64]) -> Found {
        let terms = values.iter().zip(&self.values).zip(&self.weights);
        let correlation = terms.map(|((a, b), w)| w * a * b).sum::<f64>();
        // Variance of a value: both patches have variance 1. Weights count as so many independent pixels.
        let variance = (2.0 * (1.0 - correlation)).max(1e-6);
        let count = 1.0 / self.weights.iter().map(|w| w * w).sum::<f64>();
        let sharpness = self.structure * (count / variance);
        let least = DMat2::IDENTITY * (MIN_DEVIATION * MIN_DEVIATION);
        let damped = sharpness + DMat2::IDENTITY * 1e-6;
        Found {
            pixel,
            correlation,
            information: (damped.inverse() + least).inverse(),
        }
    }
}

/// Brings values to weighted mean 0 and variance 1. Returns their standard deviation; `None` if they are equal.
fn normalise(values: &mut [f64], weights: &[f64]) -> Option<f64> {
    let mean: f64 = values.iter().zip(weights).map(|(v, w)| v * w).sum();
    values.iter_mut().for_each(|v| *v -= mean);
    let variance: f64 = values.iter().zip(weights).map(|(v, w)| v * v * w).sum();
    let deviation = variance.sqrt();
    if !(deviation > 1e-9 && deviation.is_finite()) {
        return None;
    }
    values.iter_mut().for_each(|v| *v /= deviation);
    Some(deviation)
}

fn outer(v: DVec2) -> DMat2 {
    DMat2::from_cols(v * v.x, v * v.y)
}

fn trace(m: DMat2) -> f64 {
    m.x_axis.x + m.y_axis.y
}
