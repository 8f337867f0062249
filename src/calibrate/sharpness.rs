//! Sharpness of each photograph relative to the others that show the same edges.
//!
//! Two photographs that see two neighbouring surface points from about the same distance should show the same step of
//! brightness between them. A photograph that is blurred by motion or focus shows a smaller one. Steps are compared for each pair
//! of photographs, in both directions, so that the loss by interpolation cancels. Each is chosen and weighted by what further
//! photographs show of it, so that the noise of the two does not count (instrumental variables; Fuller 1987, section 1.4). One
//! contrast per photograph is then fitted to all pairs by least squares. Its standard error is that of the jackknife over groups of
//! surface points (Efron and Stein 1981).

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::capture::photograph::Photograph;
use crate::math::color::luminance;
use crate::math::rng::splitmix64;
use crate::math::stats::{Moments, quantile};
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use glam::{Vec2, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Approximate number of pairs of neighbouring pixels that are sampled in each photograph.
const PAIRS: usize = 6_000;
/// Greatest number of photographs that each one is compared with.
const OTHERS: usize = 24;
/// Least step that counts, in log luminance, in the mean of further photographs.
const MIN_STEP: f32 = 0.1;
/// Steps are clamped to this, in log luminance.
const MAX_STEP: f32 = 1.0;
/// Ratios between two photographs' contrasts count up to this standard error of their logarithm. More is outside of where its
/// estimate is linear.
const MAX_ERROR: f64 = 0.3;
/// Least number of photographs that share edges for which their median contrast is meaningful.
const MIN_PHOTOGRAPHS: usize = 4;
/// Range of the distance of the two points in the other photograph, in its pixels.
const SIMILAR_RESOLUTION: [f32; 2] = [0.75, 1.33];
/// Relative difference of depths along a ray up to which they belong to the same surface.
const SAME_DEPTH: f32 = 0.02;
/// Pixels darker than this fraction of a photograph's median hold mostly noise.
const ABOVE_NOISE: f64 = 0.1;
/// Number of groups of surface points.
const GROUPS: u8 = 8;
/// Side of the cubes whose points are in one group, as a fraction of the scene's diameter: 10 cm in a room of 5 m.
const CUBE: f32 = 0.02;
/// A contrast counts as lower than 1 by this many standard errors.
const ERRORS: f64 = 2.0;
/// Photographs whose relative contrast is surely below this are reported as blurred.
const BLURRED: f64 = 0.85;
/// Regularization of the undetermined directions of the least-squares fit.
const RIDGE: f64 = 1e-6;

/// Sharpness of photographs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sharpness {
    /// For each photograph, the contrast of its edges relative to the median of the photographs that share edges with it, or with
    /// those that do; `None` if it shares too few, or only those of one group of surface points.
    pub contrast: Vec<Option<Contrast>>,
}

/// A measured contrast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contrast {
    /// Relative to the median.
    pub ratio: f64,
    /// Standard error of its logarithm.
    pub error: f64,
}

impl Contrast {
    /// The greatest contrast that the measurement leaves open.
    fn at_most(self) -> f64 {
        self.ratio * (ERRORS * self.error).exp()
    }
}

/// The steps of log luminance between the same two points in two photographs, each times the mean step of further ones.
#[derive(Debug, Clone, Copy)]
struct Step {
    other: u32,
    /// Step in the photograph whose pixels the points are.
    own: f32,
    /// Step in the other photograph.
    others: f32,
    /// The group of its surface point.
    group: u8,
}

/// How the contrast of a photograph compares to that of another one.
#[derive(Debug, Clone, Copy)]
struct Ratio {
    other: usize,
    logarithm: f64,
    /// Variance of the logarithm.
    variance: f64,
}

/// Log luminance of a photograph's pixels; NaN where a pixel is masked, held out, saturated or too dark.
struct Levels<'a> {
    photograph: &'a Photograph,
    logarithms: Vec<f32>,
}

impl Sharpness {
    /// Compares the photographs that are not `left_out` on pixels that are not held out.
    pub fn new(problem: &Problem, hold_out: HoldOut, left_out: &[bool]) -> Self {
        let levels: Vec<Levels> = (problem.photographs.par_iter().enumerate())
            .map(|(frame, photograph)| Levels::new(photograph, frame, hold_out))
            .collect();
        let steps: Vec<Vec<Step>> = (0..levels.len())
            .into_par_iter()
            .map(|frame| match left_out[frame] {
                true => Vec::new(),
                false => steps(problem, &levels, left_out, frame),
            })
            .collect();
        let logarithms = |without: Option<u8>| {
            let ratios: Vec<_> = steps.iter().map(|steps| ratios(steps, without)).collect();
            fit_contrasts(&ratios).unwrap_or_else(|| vec![None; steps.len()])
        };
        let all = logarithms(None);
        let parts: Vec<_> = (0..GROUPS).map(|group| logarithms(Some(group))).collect();
        let contrast = |frame: usize| {
            let parts: Option<Moments> = parts.iter().map(|part| part[frame]).collect();
            Some(Contrast {
                ratio: all[frame]?.exp(),
                // The jackknife's: values that leave out one of n groups differ by 1 / (n − 1) of what the groups do.
                error: parts?.standard_error() * f64::from(GROUPS - 1),
            })
        };
        Self {
            contrast: (0..steps.len()).map(contrast).collect(),
        }
    }

    /// One sentence that names the blurred photographs; `None` if there are none.
    pub fn remark(&self) -> Option<String> {
        let mut blurred: Vec<(usize, f64)> = (self.contrast.iter().enumerate())
            .filter_map(|(frame, contrast)| Some((frame, (*contrast)?)))
            .filter(|(_, contrast)| contrast.at_most() < BLURRED)
            .map(|(frame, contrast)| (frame, contrast.ratio))
            .collect();
        blurred.sort_by(|a, b| a.1.total_cmp(&b.1));
        let each: Vec<String> = (blurred.iter())
            .map(|(frame, contrast)| format!("{frame} ({:.0} %)", 100.0 * contrast))
            .collect();
        (!each.is_empty()).then(|| {
            format!(
                "frames whose edges have less than {:.0} % of the median contrast are blurred and weigh less in textures: {} \
                 (counted from 0)",
                100.0 * BLURRED,
                each.join(", ")
            )
        })
    }

    /// Weight of a photograph's pixels for fine detail: its squared contrast, the power of the signal relative to the same noise,
    /// at most 1. A contrast counts as the greatest that its error leaves open, and as 1 if it is unknown.
    pub fn weight(&self, frame: usize) -> f32 {
        let contrast = self.contrast.get(frame).copied().flatten();
        contrast.map_or(1.0, Contrast::at_most).min(1.0).powi(2) as f32
    }
}

/// How a photograph compares to each of those that share `steps` with it, in order of these, by all steps but those of one group.
/// Ratios with the steps of the other are too large by what interpolation loses.
fn ratios(steps: &[Step], without: Option<u8>) -> Vec<Ratio> {
    (steps.chunk_by(|a, b| a.other == b.other))
        .filter_map(|pair| {
            let counts = |step: &&Step| Some(step.group) != without;
            // Logarithm of a sum, and its variance to first order.
            let sum = |values: &dyn Fn(&Step) -> f32| {
                let values = || {
                    pair.iter()
                        .filter(counts)
                        .map(|step| f64::from(values(step)))
                };
                let (sum, squares) = (values().sum::<f64>(), values().map(|v| v * v).sum::<f64>());
                (sum > 0.0).then(|| (sum.ln(), squares / (sum * sum)))
            };
            let (own, others) = (sum(&|step| step.own)?, sum(&|step| step.others)?);
            Some(Ratio {
                other: pair[0].other as usize,
                logarithm: own.0 - others.0,
                variance: own.1 + others.1,
            })
        })
        .collect()
}

/// Logarithms of the least-squares contrasts of photographs, scaled to a median of 1, from their [`ratios`]; `None` where too few
/// share edges.
fn fit_contrasts(ratios: &[Vec<Ratio>]) -> Option<Vec<Option<f64>>> {
    let frames = ratios.len();
    let mut matrix = DMatrix::<f64>::identity(frames, frames) * RIDGE;
    let mut right = DVector::<f64>::zeros(frames);
    let mut groups: Vec<usize> = (0..frames).collect();
    for (frame, own) in ratios.iter().enumerate() {
        for ratio in own.iter().filter(|ratio| ratio.other > frame) {
            let other = ratio.other;
            let Some(back) = ratios[other].iter().find(|back| back.other == frame) else {
                continue;
            };
            // Half the difference of both directions: what interpolation loses cancels.
            let difference = 0.5 * (ratio.logarithm - back.logarithm);
            let variance = 0.25 * (ratio.variance + back.variance);
            if variance > MAX_ERROR * MAX_ERROR {
                continue;
            }
            let weight = 1.0 / variance;
            for (a, b, sign) in [(frame, other, 1.0), (other, frame, -1.0)] {
                matrix[(a, a)] += weight;
                matrix[(a, b)] -= weight;
                right[a] += sign * weight * difference;
            }
            let [joined, group] = [groups[other], groups[frame]];
            for of in groups.iter_mut().filter(|of| **of == joined) {
                *of = group;
            }
        }
    }
    let logarithms = matrix.cholesky()?.solve(&right);

    // Nothing is known between photographs that no chain of shared edges joins.
    let contrast = |frame: usize| {
        let mut group: Vec<f64> = (logarithms.iter().zip(&groups))
            .filter(|(_, group)| **group == groups[frame])
            .map(|(logarithm, _)| *logarithm)
            .collect();
        if group.len() < MIN_PHOTOGRAPHS {
            return None;
        }
        let median = quantile(&mut group, 0.5)?;
        Some(logarithms[frame] - median)
    };
    Some((0..frames).map(contrast).collect())
}

/// The steps between neighbouring pixels of a photograph, each with the step between the same points in another one, in the order of
/// the others.
fn steps(problem: &Problem, levels: &[Levels], left_out: &[bool], frame: usize) -> Vec<Step> {
    let scene = &*problem.scene;
    let own = &levels[frame];
    let (width, height) = (own.photograph.width, own.photograph.height);
    let spacing = (f64::from(width) * f64::from(height) * 2.0 / PAIRS as f64).sqrt();
    let spacing = (spacing.ceil() as usize).max(1);
    let others = similar_views(scene, left_out, frame);
    let rows = (0..height.saturating_sub(1)).step_by(spacing);
    let pixels = rows.flat_map(|y| {
        (0..width.saturating_sub(1))
            .step_by(spacing)
            .map(move |x| [x, y])
    });
    let mut steps = Vec::new();
    for [x, y] in pixels {
        for [u, v] in [[x + 1, y], [x, y + 1]] {
            let step = own.at([u, v]) - own.at([x, y]);
            let hits = [[x, y], [u, v]].map(|pixel| point(scene, frame, pixel, width));
            let [Some((object, a)), Some((neighbour, b))] = hits else {
                continue;
            };
            if object != neighbour || step.is_nan() {
                continue;
            }
            let clamped = |step: f32| step.clamp(-MAX_STEP, MAX_STEP);
            let seen: Vec<(usize, f32)> = (others.iter())
                .filter_map(|&other| {
                    let step = step_in(scene, &levels[other], other, object, [a, b])?;
                    Some((other, clamped(step)))
                })
                .collect();
            let sum: f32 = seen.iter().map(|(_, step)| step).sum();
            for &(other, others) in &seen {
                // NaN without further photographs; the step is left out then.
                let further = (sum - others) / (seen.len() as f32 - 1.0);
                if further.abs() >= MIN_STEP {
                    steps.push(Step {
                        other: other as u32,
                        own: clamped(step) * further,
                        others: others * further,
                        group: group(a / (CUBE * scene.diameter)),
                    });
                }
            }
        }
    }
    steps.sort_by_key(|step| step.other);
    steps
}

/// The group of a surface point, in cubes of side 1.
fn group(point: Vec3) -> u8 {
    let cell = point.floor().as_i64vec3();
    let hash = (cell.to_array().into_iter()).fold(0, |hash, i| splitmix64(hash ^ i as u64));
    (hash % u64::from(GROUPS)) as u8
}

/// The frames with the most similar views: nearby cameras with a similar direction.
fn similar_views(scene: &Scene, left_out: &[bool], frame: usize) -> Vec<usize> {
    let camera = &scene.cameras[frame];
    let mut all: Vec<(f32, usize)> = (scene.cameras.iter().enumerate())
        .filter(|&(other, _)| other != frame && !left_out[other])
        .map(|(other, view)| {
            let distance =
                view.center.distance(camera.center) / scene.diameter.max(f32::MIN_POSITIVE);
            (distance - view.forward().dot(camera.forward()), other)
        })
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter()
        .take(OTHERS)
        .map(|(_, other)| other)
        .collect()
}

/// The object and the surface point that a pixel's centre sees.
fn point(scene: &Scene, frame: usize, [x, y]: [u32; 2], width: u32) -> Option<(u32, Vec3)> {
    let triangle = scene.ids().triangles[frame][(y * width + x) as usize];
    let ray = scene.cameras[frame].ray(Vec2::new(x as f32, y as f32) + 0.5);
    let object = *scene.object_of.get(triangle as usize)?;
    let distance = scene.plane_distance(triangle, &ray);
    let is_ahead = distance.is_finite() && distance > 0.0;
    is_ahead.then(|| (object, ray.origin + ray.direction * distance))
}

/// The step between two points of an object in another photograph; `None` unless it sees both, at a similar resolution.
fn step_in(
    scene: &Scene,
    levels: &Levels,
    frame: usize,
    object: u32,
    points: [Vec3; 2],
) -> Option<f32> {
    let camera = &scene.cameras[frame];
    let [a, b] = points.map(|point| camera.project(point));
    let (a, b) = (a?, b?);
    let [min, max] = SIMILAR_RESOLUTION;
    if !(min..=max).contains(&a.distance(b)) {
        return None;
    }
    for (at, point) in [(a, points[0]), (b, points[1])] {
        let pixel = at.y as u32 * levels.photograph.width + at.x as u32;
        let triangle = *scene.ids().triangles[frame].get(pixel as usize)?;
        if scene.object_of.get(triangle as usize) != Some(&object) {
            return None;
        }
        let to_point = point - camera.center;
        let distance = to_point.length();
        let visible = scene.plane_distance(triangle, &Ray::new(camera.center, to_point / distance));
        let is_same = (visible - distance).abs() <= SAME_DEPTH * distance;
        if !is_same {
            return None;
        }
    }
    let step = levels.interpolated(b) - levels.interpolated(a);
    (!step.is_nan()).then_some(step)
}

impl<'a> Levels<'a> {
    fn new(photograph: &'a Photograph, frame: usize, hold_out: HoldOut) -> Self {
        let mut luminances: Vec<f64> = (photograph.pixels.iter().enumerate())
            .filter(|(index, _)| photograph.is_usable(*index))
            .map(|(_, &pixel)| f64::from(luminance(pixel)))
            .collect();
        let dark = (quantile(&mut luminances, 0.5).unwrap_or(0.0) * ABOVE_NOISE) as f32;
        let logarithm = |(index, &pixel): (usize, &Vec3)| {
            let level = luminance(pixel);
            let fitted =
                photograph.is_usable(index) && !hold_out.contains(frame as u32, index as u32);
            match fitted && level > dark && !photograph.is_saturated(index) {
                true => level.ln(),
                false => f32::NAN,
            }
        };
        let pixels = photograph.pixels.iter().enumerate();
        Self {
            logarithms: pixels.map(logarithm).collect(),
            photograph,
        }
    }

    fn at(&self, [x, y]: [u32; 2]) -> f32 {
        self.logarithms[(y * self.photograph.width + x) as usize]
    }

    /// Bilinear interpolation; NaN outside the image or where one of the four pixels is NaN.
    fn interpolated(&self, at: Vec2) -> f32 {
        let corner = at - 0.5;
        let (x, y) = (corner.x.floor(), corner.y.floor());
        let (width, height) = (self.photograph.width, self.photograph.height);
        if x < 0.0 || y < 0.0 || x + 1.0 >= width as f32 || y + 1.0 >= height as f32 {
            return f32::NAN;
        }
        let (fx, fy) = (corner.x - x, corner.y - y);
        let (x, y) = (x as u32, y as u32);
        let row = |y: u32| self.at([x, y]) * (1.0 - fx) + self.at([x + 1, y]) * fx;
        row(y) * (1.0 - fy) + row(y + 1) * fy
    }
}
