//! Non-uniform selection of the pixels of a batch.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::inverse::paper::pixel::Drawn;
use crate::inverse::settings::Settings;
use crate::math::cumulative::Cumulative;
use crate::math::rng::Stream;
use crate::scene::visibility::NOTHING;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, radiance};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Side of the blocks of pixels that share a residual.
const BLOCK: u32 = 8;
/// Paths for each block's residual.
const PATHS: u64 = 4;
/// Fraction of uniform draws.
const UNIFORM_FRACTION: f64 = 0.2;

/// Pixels in groups, each with its own probability.
pub struct Groups {
    /// For each group, its pixels as (frame, pixel).
    pixels: Vec<Vec<(u32, u32)>>,
    probabilities: Cumulative,
    total: usize,
    /// Whether gradients are weighted to be unbiased for uniform draws.
    weighted: bool,
}

impl Groups {
    /// Groups by object, with equal probabilities.
    pub fn by_object(problem: &Problem, settings: &Settings, weighted: bool) -> Self {
        let scene = &problem.scene;
        let seen = &scene.ids().triangles;
        Self::new(problem, settings, weighted, |frame, pixel| {
            let triangle = seen[frame][pixel as usize];
            (triangle != NOTHING).then(|| scene.object_of[triangle as usize] as usize)
        })
    }

    /// Groups by blocks of pixels, at first with equal probabilities.
    pub fn by_block(problem: &Problem, settings: &Settings, weighted: bool) -> Self {
        let width = problem.photographs.first().map_or(1, |p| p.width);
        let height = problem.photographs.first().map_or(1, |p| p.height);
        let (across, down) = (width.div_ceil(BLOCK), height.div_ceil(BLOCK));
        Self::new(problem, settings, weighted, |frame, pixel| {
            let (x, y) = (pixel % width / BLOCK, pixel / width / BLOCK);
            Some(frame * (across * down) as usize + (y * across + x) as usize)
        })
    }

    fn new(
        problem: &Problem,
        settings: &Settings,
        weighted: bool,
        group: impl Fn(usize, u32) -> Option<usize>,
    ) -> Self {
        let mut pixels: Vec<Vec<(u32, u32)>> = Vec::new();
        for (frame, photograph) in problem.photographs.iter().enumerate() {
            for pixel in 0..photograph.pixels.len() as u32 {
                let usable = photograph.is_usable(pixel as usize);
                if !usable || HoldOut::from(settings).contains(frame as u32, pixel) {
                    continue;
                }
                let Some(place) = group(frame, pixel) else {
                    continue;
                };
                if place >= pixels.len() {
                    pixels.resize(place + 1, Vec::new());
                }
                pixels[place].push((frame as u32, pixel));
            }
        }
        pixels.retain(|group| !group.is_empty());
        let total = pixels.iter().map(Vec::len).sum();
        Self {
            probabilities: probabilities(&vec![1.0; pixels.len()]),
            pixels,
            total,
            weighted,
        }
    }

    pub fn draw(&self, stream: &mut Stream) -> Option<Drawn> {
        let at = stream.uniform_f64();
        let group = self.probabilities.index_at(at)?;
        let chance = self.probabilities.sums()[group] - self.probabilities.before(group);
        let pixels = &self.pixels[group];
        let (frame, pixel) = pixels[stream.below(pixels.len())];
        let weight = if self.weighted {
            (pixels.len() as f64 / self.total as f64 / chance) as f32
        } else {
            1.0
        };
        Some(Drawn {
            frame,
            pixel,
            weight,
        })
    }

    /// Sets each group's probability in proportion to its number of pixels times its residual, estimated by a few
    /// paths, mixed with a uniform fraction. Returns the rays cast.
    pub fn update(
        &mut self,
        problem: &Problem,
        lit: &LitScene,
        options: &PathOptions,
        key: u64,
    ) -> u64 {
        let found: Vec<(f64, u64)> = (self.pixels.par_iter().enumerate())
            .map(|(group, pixels)| {
                let (mut difference, mut rays) = (Vec3::ZERO, 0);
                for path in 0..PATHS {
                    let mut stream = Stream::new(key, group as u64, 0, path);
                    let (frame, pixel) = pixels[stream.below(pixels.len())];
                    let photograph = &problem.photographs[frame as usize];
                    let camera = &problem.scene.cameras[frame as usize];
                    let corner = camera.corner(pixel as usize);
                    let ray = camera.ray(corner + Vec2::from(stream.uniform2()));
                    let sample = radiance(lit, &ray, &mut stream, options);
                    difference += sample.radiance - photograph.pixels[pixel as usize];
                    rays += u64::from(sample.rays);
                }
                (f64::from(difference.abs().element_sum()), rays)
            })
            .collect();
        let sizes = || self.pixels.iter().map(|p| p.len() as f64);
        let each: Vec<f64> = found.iter().zip(sizes()).map(|((r, _), n)| r * n).collect();
        let sum = each.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let fractions: Vec<f64> = (each.iter().zip(sizes()))
            .map(|(r, n)| {
                UNIFORM_FRACTION * n / self.total as f64 + (1.0 - UNIFORM_FRACTION) * r / sum
            })
            .collect();
        self.probabilities = probabilities(&fractions);
        found.iter().map(|(_, rays)| rays).sum()
    }
}

/// Probabilities in proportion to `fractions`.
fn probabilities(fractions: &[f64]) -> Cumulative {
    let sum: f64 = fractions.iter().sum();
    Cumulative::new(fractions.iter().map(|fraction| fraction / sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::experiments::box_room::photographed;

    #[test]
    fn objects_are_drawn_alike_and_weights_make_every_pixel_count_the_same() {
        let subject = photographed(true).expect("a room");
        let (problem, settings) = (&subject.problem, Settings::default());
        let groups = Groups::by_object(problem, &settings, true);
        let objects = groups.pixels.len();
        assert_eq!(objects, problem.scene.objects.len());
        let mut counts = vec![(0.0, 0.0); objects];
        let draws = 80_000;
        for i in 0..draws {
            let drawn = groups.draw(&mut Stream::new(5, 0, 0, i)).expect("a pixel");
            let group = (groups.pixels.iter())
                .position(|g| g.contains(&(drawn.frame, drawn.pixel)))
                .expect("of a group");
            counts[group].0 += 1.0 / draws as f64;
            counts[group].1 += f64::from(drawn.weight) / draws as f64;
        }
        for ((chance, weight), pixels) in counts.iter().zip(&groups.pixels) {
            // Five standard deviations of a binomial fraction of one in eight.
            let off = (chance - 1.0 / objects as f64).abs();
            assert!(off < 5.0 * 0.33 / 282.0, "{chance}");
            let fraction = pixels.len() as f64 / groups.total as f64;
            let ratio = weight / fraction;
            assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        }
    }
}
