//! How sharp each photograph is beside the others that show the same edges.
//!
//! Two photographs that see the same two neighbouring points of a surface from about as far should show the same step of
//! brightness between them; one that is blurred, by motion or focus, shows a smaller one. Steps well above noise are
//! compared for each pair of photographs, once at the pixels of either, so that interpolation in the other cancels; one
//! sharpness a photograph explains all pairs in least squares.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::capture::photograph::Photograph;
use crate::math::color::luminance;
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use glam::{Vec2, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Pairs of neighbouring pixels that are looked at in each photograph, about.
const PAIRS: usize = 6_000;
/// Photographs that each is compared with at most.
const OTHERS: usize = 24;
/// A step counts from this on, as a logarithm, ...
const MIN_STEP: f32 = 0.1;
/// ... and from so many times the usual one on, which is mostly noise.
const ABOVE_USUAL: f32 = 4.0;
/// A step counts as no larger than this.
const MAX_STEP: f32 = 1.0;
/// Steps that two photographs must share, seen from either.
const MIN_STEPS: usize = 40;
/// Photographs that must be compared, for the usual sharpness to say something.
const MIN_PHOTOGRAPHS: usize = 4;
/// Distances in the other photograph's pixels at which two points are as fine there.
const AS_FINE: [f32; 2] = [0.75, 1.33];
/// Depths along a ray that differ by a smaller share are of the same surface.
const SAME_DEPTH: f32 = 0.02;
/// Pixels darker than this fraction of a photograph's median hold mostly noise.
const ABOVE_NOISE: f64 = 0.1;
/// Edges with less of the usual contrast are worth a word.
const BLURRED: f64 = 0.85;
/// Relative weight that keeps what is open at the usual sharpness.
const OPEN: f64 = 1e-6;

/// How sharp photographs are: the contrast of edges beside the usual one, 1; `None` where too little is shared to tell.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sharpness {
    /// One a photograph.
    pub contrast: Vec<Option<f64>>,
}

/// The logarithmic steps of two photographs between the same points.
#[derive(Debug, Clone, Copy)]
struct Step {
    other: u32,
    own: f32,
    others: f32,
}

/// What a photograph shares with the others.
#[derive(Debug, Default)]
struct Steps {
    /// The larger of both photographs' steps, for each that is shared.
    sizes: Vec<f32>,
    /// Those that could be more than noise.
    large: Vec<Step>,
}

/// A photograph's pixels as logarithms of luminance; not a number where one says nothing.
struct Levels<'a> {
    photograph: &'a Photograph,
    logarithms: Vec<f32>,
}

impl Step {
    /// The larger of both.
    fn size(&self) -> f32 {
        self.own.abs().max(self.others.abs())
    }
}

impl Sharpness {
    /// Compares the photographs that are not `left_out`, by pixels that are not held out.
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
        let mut sizes: Vec<f32> = Vec::with_capacity(steps.iter().map(|s| s.sizes.len()).sum());
        for of_frame in &mut steps {
            sizes.append(&mut of_frame.sizes);
        }
        let least = MIN_STEP.max(ABOVE_USUAL * middle(&mut sizes));
        Self {
            contrast: explained(&ratios(&steps, least), frames),
        }
    }

    /// Which photographs are blurred, in one sentence; `None` where none is.
    pub fn remark(&self) -> Option<String> {
        let blurred = |(frame, contrast): (usize, &Option<f64>)| {
            Some((frame, contrast.filter(|c| *c < BLURRED)?))
        };
        let mut all: Vec<(usize, f64)> = self
            .contrast
            .iter()
            .enumerate()
            .filter_map(blurred)
            .collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        let each: Vec<String> = (all.iter())
            .map(|(frame, contrast)| format!("{frame} ({:.0} %)", 100.0 * contrast))
            .collect();
        (!each.is_empty()).then(|| {
            format!(
                "frames that show edges with less than {:.0} % of the usual contrast are blurred and say less of textures: {} \
                 (counted from 0)",
                100.0 * BLURRED,
                each.join(", ")
            )
        })
    }

    /// How much a photograph's pixels say of what is fine: the squared contrast of a blurred one, as a signal beside the same noise;
    /// 1 of others, since noise adds contrast too, and where it is not told.
    pub fn weight(&self, frame: usize) -> f32 {
        let contrast = self.contrast.get(frame).copied().flatten();
        contrast.unwrap_or(1.0).min(1.0).powi(2) as f32
    }
}

/// One in the middle of some numbers by size; 0 where there are none.
fn middle(values: &mut [f32]) -> f32 {
    let place = values.len() / 2;
    match values.is_empty() {
        true => 0.0,
        false => *values.select_nth_unstable_by(place, f32::total_cmp).1,
    }
}

/// For ordered pairs of photographs, the logarithm of the ratio of the energies of steps, and how many there are.
fn ratios(steps: &[Steps], least: f32) -> Vec<Vec<(usize, f64, usize)>> {
    let of = |steps: &Steps| {
        let mut large: Vec<&Step> = (steps.large.iter())
            .filter(|step| step.size() >= least)
            .collect();
        large.sort_by_key(|step| step.other);
        let energy = |step: f32| f64::from(step.clamp(-MAX_STEP, MAX_STEP)).powi(2);
        (large.chunk_by(|a, b| a.other == b.other))
            .map(|of_pair| {
                let own: f64 = of_pair.iter().map(|s| energy(s.own)).sum();
                let others: f64 = of_pair.iter().map(|s| energy(s.others)).sum();
                (
                    of_pair[0].other as usize,
                    (own / others).ln(),
                    of_pair.len(),
                )
            })
            .filter(|(_, ratio, _)| ratio.is_finite())
            .collect()
    };
    steps.iter().map(of).collect()
}

/// The contrasts that explain the ratios best, their median 1.
fn explained(ratios: &[Vec<(usize, f64, usize)>], frames: usize) -> Vec<Option<f64>> {
    let mut matrix = DMatrix::<f64>::identity(frames, frames) * OPEN;
    let mut right = DVector::<f64>::zeros(frames);
    let mut pairs = vec![0; frames];
    for (frame, of_frame) in ratios.iter().enumerate() {
        for &(other, ratio, count) in of_frame.iter().filter(|pair| pair.0 > frame) {
            let back = ratios[other].iter().find(|pair| pair.0 == frame);
            let Some(&(_, back, count_back)) = back else {
                continue;
            };
            let count = count.min(count_back);
            if count < MIN_STEPS {
                continue;
            }
            // Half the difference of energies is that of contrasts; half again the mean of both ways to look.
            let (difference, weight) = (0.25 * (ratio - back), count as f64);
            for (a, b, sign) in [(frame, other, 1.0), (other, frame, -1.0)] {
                matrix[(a, a)] += weight;
                matrix[(a, b)] -= weight;
                right[a] += sign * weight * difference;
                pairs[a] += 1;
            }
        }
    }
    let none = vec![None; frames];
    let Some(factor) = matrix.cholesky() else {
        return none;
    };
    let found = factor.solve(&right);
    let told = |frame: &usize| pairs[*frame] > 0;
    let mut known: Vec<f64> = (0..frames).filter(told).map(|frame| found[frame]).collect();
    if known.len() < MIN_PHOTOGRAPHS {
        return none;
    }
    let Some(middle) = quantile(&mut known, 0.5) else {
        return none;
    };
    (0..frames)
        .map(|frame| told(&frame).then(|| (found[frame] - middle).exp()))
        .collect()
}

/// The steps between neighbouring pixels of a photograph, and between the same points in others.
fn steps(problem: &Problem, levels: &[Levels], left_out: &[bool], frame: usize) -> Steps {
    let scene = &*problem.scene;
    let own = &levels[frame];
    let (width, height) = (own.photograph.width, own.photograph.height);
    let apart = (f64::from(width) * f64::from(height) * 2.0 / PAIRS as f64).sqrt();
    let apart = (apart.ceil() as usize).max(1);
    let others = others(scene, left_out, frame);
    let places = (0..height.saturating_sub(1)).step_by(apart);
    let places = places.flat_map(|y| {
        (0..width.saturating_sub(1))
            .step_by(apart)
            .map(move |x| [x, y])
    });
    let mut found = Steps::default();
    for [x, y] in places {
        for [u, v] in [[x + 1, y], [x, y + 1]] {
            let step = own.at([u, v]) - own.at([x, y]);
            let seen = [
                point(scene, frame, [x, y], width),
                point(scene, frame, [u, v], width),
            ];
            let [Some((object, a)), Some((beside, b))] = seen else {
                continue;
            };
            if object != beside || step.is_nan() {
                continue;
            }
            for &other in &others {
                let there = step_in(scene, &levels[other], other, object, [a, b]);
                let Some(others) = there else {
                    continue;
                };
                let both = Step {
                    other: other as u32,
                    own: step,
                    others,
                };
                found.sizes.push(both.size());
                if both.size() >= MIN_STEP {
                    found.large.push(both);
                }
            }
        }
    }
    found
}

/// The photographs that look most alike from where another was taken: those that look the same way from nearby.
fn others(scene: &Scene, left_out: &[bool], frame: usize) -> Vec<usize> {
    let camera = &scene.cameras[frame];
    let mut all: Vec<(f32, usize)> = (scene.cameras.iter().enumerate())
        .filter(|&(other, _)| other != frame && !left_out[other])
        .map(|(other, there)| {
            let apart =
                there.center.distance(camera.center) / scene.diameter.max(f32::MIN_POSITIVE);
            (apart - there.forward().dot(camera.forward()), other)
        })
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter()
        .take(OTHERS)
        .map(|(_, other)| other)
        .collect()
}

/// The object and the point that a pixel's middle sees.
fn point(scene: &Scene, frame: usize, [x, y]: [u32; 2], width: u32) -> Option<(u32, Vec3)> {
    let triangle = scene.ids().triangles[frame][(y * width + x) as usize];
    let ray = scene.cameras[frame].ray(Vec2::new(x as f32, y as f32) + 0.5);
    let object = *scene.object_of.get(triangle as usize)?;
    let distance = scene.plane_distance(triangle, &ray);
    let is_ahead = distance.is_finite() && distance > 0.0;
    is_ahead.then(|| (object, ray.origin + ray.direction * distance))
}

/// The step between two points of an object in another photograph, where it sees both about as finely.
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
    let [least, most] = AS_FINE;
    if !(least..=most).contains(&a.distance(b)) {
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
        let seen = scene.plane_distance(triangle, &Ray::new(camera.center, to_point / distance));
        let is_same = (seen - distance).abs() <= SAME_DEPTH * distance;
        if !is_same {
            return None;
        }
    }
    let step = levels.between(b) - levels.between(a);
    (!step.is_nan()).then_some(step)
}

impl<'a> Levels<'a> {
    fn new(photograph: &'a Photograph, frame: usize, hold_out: HoldOut) -> Self {
        let mut all: Vec<f64> = (photograph.pixels.iter().enumerate())
            .filter(|(index, _)| photograph.is_usable(*index))
            .map(|(_, &pixel)| f64::from(luminance(pixel)))
            .collect();
        let least = (quantile(&mut all, 0.5).unwrap_or(0.0) * ABOVE_NOISE) as f32;
        let says = |(index, &pixel): (usize, &Vec3)| {
            let level = luminance(pixel);
            let told =
                photograph.is_usable(index) && !hold_out.contains(frame as u32, index as u32);
            match told && level > least && !photograph.is_saturated(index) {
                true => level.ln(),
                false => f32::NAN,
            }
        };
        Self {
            logarithms: photograph.pixels.iter().enumerate().map(says).collect(),
            photograph,
        }
    }

    fn at(&self, [x, y]: [u32; 2]) -> f32 {
        self.logarithms[(y * self.photograph.width + x) as usize]
    }

    /// Between the middles of four pixels; not a number outside or where one of them says nothing.
    fn between(&self, at: Vec2) -> f32 {
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
