//! Sharpness of each photograph relative to the others that show the same edges.
//!
//! Two photographs that see two neighbouring surface points from about the same distance should show the same step of
//! brightness between them. A photograph that is blurred by motion or focus shows a smaller one. Steps well above noise are
//! compared for each pair of photographs, in both directions, so that the loss by interpolation cancels. One contrast per
//! photograph is then fitted to all pairs by least squares.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::capture::photograph::Photograph;
use crate::math::color::luminance;
use crate::math::stats::{quantile, upper_median};
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use glam::{Vec2, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Approximate number of pairs of neighbouring pixels that are sampled in each photograph.
const PAIRS: usize = 6_000;
/// Greatest number of photographs that each one is compared with.
const OTHERS: usize = 24;
/// Least step that counts, in log luminance.
const MIN_STEP: f32 = 0.1;
/// Least step that counts, as a multiple of the median step, which is mostly noise.
const ABOVE_MEDIAN: f32 = 4.0;
/// Steps are clamped to this, in log luminance.
const MAX_STEP: f32 = 1.0;
/// Least number of steps that two photographs must share in each direction.
const MIN_STEPS: usize = 40;
/// Least number of compared photographs for which the median contrast is meaningful.
const MIN_PHOTOGRAPHS: usize = 4;
/// Range of the distance of the two points in the other photograph, in its pixels.
const SIMILAR_RESOLUTION: [f32; 2] = [0.75, 1.33];
/// Relative difference of depths along a ray up to which they belong to the same surface.
const SAME_DEPTH: f32 = 0.02;
/// Pixels darker than this fraction of a photograph's median hold mostly noise.
const ABOVE_NOISE: f64 = 0.1;
/// Photographs with a relative contrast below this are reported as blurred.
const BLURRED: f64 = 0.85;
/// Regularization of the undetermined directions of the least-squares fit.
const RIDGE: f64 = 1e-6;

/// Sharpness of photographs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sharpness {
    /// For each photograph, the contrast of its edges relative to the median photograph; `None` if it shares too few edges.
    pub contrast: Vec<Option<f64>>,
}

/// The steps of log luminance between the same two points in two photographs.
#[derive(Debug, Clone, Copy)]
struct Step {
    other: u32,
    /// Step in the photograph whose pixels the points are.
    own: f32,
    /// Step in the other photograph.
    others: f32,
}

/// The steps that a photograph shares with the others.
#[derive(Debug, Default)]
struct Steps {
    /// [`Step::size`] of each shared step.
    sizes: Vec<f32>,
    /// The steps of at least [`MIN_STEP`].
    large: Vec<Step>,
}

/// Log luminance of a photograph's pixels; NaN where a pixel is masked, held out, saturated or too dark.
struct Levels<'a> {
    photograph: &'a Photograph,
    logarithms: Vec<f32>,
}

impl Step {
    fn size(&self) -> f32 {
        self.own.abs().max(self.others.abs())
    }
}

impl Sharpness {
    /// Compares the photographs that are not `left_out` on pixels that are not held out.
    pub fn new(problem: &Problem, hold_out: HoldOut, left_out: &[bool]) -> Self {
        let levels: Vec<Levels> = (problem.photographs.par_iter().enumerate())
            .map(|(frame, photograph)| Levels::new(photograph, frame, hold_out))
            .collect();
        let frames = levels.len();
        let mut steps: Vec<Steps> = (0..frames)
            .into_par_iter()
            .map(|frame| match left_out[frame] {
                true => Steps::default(),
                false => steps(problem, &levels, left_out, frame),
            })
            .collect();
        let mut sizes: Vec<f32> = (steps.iter_mut())
            .flat_map(|steps| std::mem::take(&mut steps.sizes))
            .collect();
        let median = upper_median(&mut sizes).unwrap_or(0.0);
        let min_step = MIN_STEP.max(ABOVE_MEDIAN * median);
        Self {
            contrast: fit_contrasts(&ratios(&steps, min_step))
                .unwrap_or_else(|| vec![None; frames]),
        }
    }

    /// One sentence that names the blurred photographs; `None` if there are none.
    pub fn remark(&self) -> Option<String> {
        let mut blurred: Vec<(usize, f64)> = (self.contrast.iter().enumerate())
            .filter_map(|(frame, contrast)| Some((frame, contrast.filter(|c| *c < BLURRED)?)))
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
    /// at most 1. Contrasts above 1 come from noise; unknown contrasts count as 1.
    pub fn weight(&self, frame: usize) -> f32 {
        let contrast = self.contrast.get(frame).copied().flatten();
        contrast.unwrap_or(1.0).min(1.0).powi(2) as f32
    }
}

/// For each photograph, a list of (other photograph, log ratio of the summed squares of own and other steps, number of steps),
/// over steps of at least `min_step`.
fn ratios(steps: &[Steps], min_step: f32) -> Vec<Vec<(usize, f64, usize)>> {
    let ratios_of = |steps: &Steps| {
        let mut large: Vec<&Step> = (steps.large.iter())
            .filter(|step| step.size() >= min_step)
            .collect();
        large.sort_by_key(|step| step.other);
        let energy = |step: f32| f64::from(step.clamp(-MAX_STEP, MAX_STEP)).powi(2);
        (large.chunk_by(|a, b| a.other == b.other))
            .map(|pair| {
                let own: f64 = pair.iter().map(|s| energy(s.own)).sum();
                let others: f64 = pair.iter().map(|s| energy(s.others)).sum();
                (pair[0].other as usize, (own / others).ln(), pair.len())
            })
            .filter(|(_, ratio, _)| ratio.is_finite())
            .collect()
    };
    steps.iter().map(ratios_of).collect()
}

/// The least-squares contrasts of photographs, scaled to a median of 1, from their [`ratios`]; `None` if too few share edges.
fn fit_contrasts(ratios: &[Vec<(usize, f64, usize)>]) -> Option<Vec<Option<f64>>> {
    let frames = ratios.len();
    let mut matrix = DMatrix::<f64>::identity(frames, frames) * RIDGE;
    let mut right = DVector::<f64>::zeros(frames);
    let mut pairs = vec![0; frames];
    for (frame, own) in ratios.iter().enumerate() {
        for &(other, ratio, count) in own.iter().filter(|pair| pair.0 > frame) {
            let back = ratios[other].iter().find(|pair| pair.0 == frame);
            let Some(&(_, back, count_back)) = back else {
                continue;
            };
            let count = count.min(count_back);
            if count < MIN_STEPS {
                continue;
            }
            // Energies are squared contrasts, which gives one half; the mean of both directions gives the other half.
            let (difference, weight) = (0.25 * (ratio - back), count as f64);
            for (a, b, sign) in [(frame, other, 1.0), (other, frame, -1.0)] {
                matrix[(a, a)] += weight;
                matrix[(a, b)] -= weight;
                right[a] += sign * weight * difference;
                pairs[a] += 1;
            }
        }
    }
    let logarithms = matrix.cholesky()?.solve(&right);
    let is_known = |frame: &usize| pairs[*frame] > 0;
    let mut known: Vec<f64> = (0..frames)
        .filter(is_known)
        .map(|frame| logarithms[frame])
        .collect();
    if known.len() < MIN_PHOTOGRAPHS {
        return None;
    }
    let median = quantile(&mut known, 0.5)?;
    let contrast = |frame| is_known(&frame).then(|| (logarithms[frame] - median).exp());
    Some((0..frames).map(contrast).collect())
}

/// The steps between neighbouring pixels of a photograph, each with the step between the same points in other photographs.
fn steps(problem: &Problem, levels: &[Levels], left_out: &[bool], frame: usize) -> Steps {
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
    let mut steps = Steps::default();
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
            for &other in &others {
                let Some(others) = step_in(scene, &levels[other], other, object, [a, b]) else {
                    continue;
                };
                let shared = Step {
                    other: other as u32,
                    own: step,
                    others,
                };
                steps.sizes.push(shared.size());
                if shared.size() >= MIN_STEP {
                    steps.large.push(shared);
                }
            }
        }
    }
    steps
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
