//! The light that cells receive: traced twice independently, then smoothed as far as the two agree that it may be.

use crate::inverse::texture::cells::Cells;
use crate::inverse::texture::fuse::{Problem, fuse, mean};
use crate::inverse::texture::gloss::white_base;
use crate::inverse::texture::links::Links;
use crate::inverse::texture::observations::Observations;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::warp;
use crate::scene::geometry::Hit;
use crate::transport::lit::Lit;
use crate::transport::path::PathOptions;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// First of the sample keys of these paths, far from those of the fit.
const KEY: u64 = 5 << 59;
/// Averagings over neighbours that give the level against which differences count.
const LEVELLING: u32 = 40;
/// Least level, in means over the object.
const MIN_LEVEL: f32 = 1e-2;
/// Strengths of smoothing that are tried, strongest first.
const STRENGTHS: [f32; 9] = [8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.12, 0.06, 0.03];
/// Worse strengths in a row that end the search.
const PATIENCE: u32 = 2;

/// What cells would send along their normals if they were white, below their lobe where they have one, as two independent
/// sets of paths found it.
#[derive(Debug, Clone, Default)]
pub struct Irradiance {
    /// One value a cell in each set.
    pub sets: [Vec<Vec3>; 2],
    /// Rays cast.
    pub rays: u64,
    /// Paths dropped because they were not finite.
    pub rejected: u64,
}

/// Smoothed light.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// What each cell would send if it were white.
    pub radiance: Vec<Vec3>,
    /// Relative standard error that is left, root mean square over cells.
    pub noise: f32,
}

/// Traces `samples` paths a set from random points of each cell in the range.
pub fn trace(
    lit: &Lit,
    cells: &Cells,
    range: Range<usize>,
    samples: u32,
    options: &PathOptions,
    seed: u64,
    key: u64,
) -> Irradiance {
    let traced: Vec<([Vec3; 2], u64, u64)> = range
        .into_par_iter()
        .map(|cell| {
            let (mut rays, mut rejected) = (0, 0);
            let sets = [0, 1].map(|set| {
                let mut sum = DVec3::ZERO;
                for sample in 0..samples {
                    let index = KEY + 2 * u64::from(sample) + set;
                    let mut stream = Stream::new(seed, key, cell as u64, index);
                    let (hit, normal) = point_on(lit, cells, cell, &mut stream);
                    let surface = lit.surface(&hit);
                    let (light, cast) = white_base(lit, &surface, normal, &mut stream, options);
                    sum += light.as_dvec3();
                    rays += cast.rays;
                    rejected += cast.rejected;
                }
                (sum / f64::from(samples.max(1))).as_vec3()
            });
            (sets, rays, rejected)
        })
        .collect();
    let mut irradiance = Irradiance::default();
    for (sets, rays, rejected) in traced {
        for (all, value) in irradiance.sets.iter_mut().zip(sets) {
            all.push(value);
        }
        irradiance.rays += rays;
        irradiance.rejected += rejected;
    }
    irradiance
}

/// A point uniform in area on a cell, and the normal of its seen side.
fn point_on(lit: &Lit, cells: &Cells, cell: usize, stream: &mut Stream) -> (Hit, Vec3) {
    let cell = &cells.cells[cell];
    let choice = stream.uniform();
    let within = warp::uniform_triangle(stream.uniform2());
    let scene = &lit.scene;
    let piece = match cell.pieces.as_slice() {
        [piece] => piece,
        pieces => {
            let total: f32 = pieces
                .iter()
                .map(|p| scene.areas[p.triangle as usize])
                .sum();
            let mut rest = choice * total;
            let chosen = pieces.iter().find(|p| {
                rest -= scene.areas[p.triangle as usize];
                rest < 0.0
            });
            chosen.unwrap_or(&pieces[0])
        }
    };
    let [b1, b2] = piece.within(within);
    let hit = Hit {
        t: 0.0,
        triangle: piece.triangle,
        b1,
        b2,
    };
    let normal = scene.normals[piece.triangle as usize];
    let front = cells.front(piece.triangle).unwrap_or(true);
    (hit, if front { normal } else { -normal })
}

impl Irradiance {
    /// Adds the cells that follow.
    pub fn append(&mut self, other: Self) {
        for (all, more) in self.sets.iter_mut().zip(other.sets) {
            all.extend(more);
        }
        self.rays += other.rays;
        self.rejected += other.rejected;
    }

    /// Smooths with the strength for which each set predicts the other best.
    pub fn smoothed(&self, links: &Links) -> Smoothed {
        let count = self.sets[0].len();
        let both: Vec<Vec3> = (self.sets[0].iter().zip(&self.sets[1]))
            .map(|(a, b)| (*a + *b) * 0.5)
            .collect();
        let levels = levels(&both, links);
        let each = Observations::of_each(count);
        let weights: Vec<Vec3> = levels.iter().map(|l| Vec3::splat(1.0 / (l * l))).collect();
        let problem = |values| Problem {
            observations: &each,
            weights: &weights,
            values,
            links,
            levels: &levels,
        };
        let squares = |a: &[Vec3], b: &[Vec3]| -> f64 {
            let pairs = a.iter().zip(b).zip(&weights);
            pairs
                .map(|((a, b), w)| f64::from(((*a - *b) * (*a - *b)).dot(*w)))
                .sum()
        };

        // From strong to weak, while the sets agree better and better.
        let mut smooth = [0, 1].map(|s| levelled(&self.sets[s], links));
        let mut best = (f64::INFINITY, STRENGTHS[0], 0.0);
        let mut worse = 0;
        for strength in STRENGTHS {
            smooth = [0, 1].map(|s| fuse(&problem(&self.sets[s]), strength, &smooth[s]));
            let error = squares(&smooth[0], &self.sets[1]) + squares(&smooth[1], &self.sets[0]);
            let noise = squares(&smooth[0], &smooth[1]) / (3 * count.max(1)) as f64;
            if error < best.0 {
                best = (error, strength, 0.5 * noise.sqrt());
                worse = 0;
            } else {
                worse += 1;
                if worse == PATIENCE {
                    break;
                }
            }
        }

        // Both sets together carry half the variance of one.
        let strength = best.1 * std::f32::consts::FRAC_1_SQRT_2;
        let start: Vec<Vec3> = (smooth[0].iter().zip(&smooth[1]))
            .map(|(a, b)| (*a + *b) * 0.5)
            .collect();
        Smoothed {
            radiance: fuse(&problem(&both), strength, &start),
            noise: best.2 as f32,
        }
    }
}

/// A wide local mean.
fn levelled(values: &[Vec3], links: &Links) -> Vec<Vec3> {
    let mut level = values.to_vec();
    for _ in 0..LEVELLING {
        level = (0..level.len())
            .into_par_iter()
            .map(|cell| {
                let mut sum = level[cell];
                let mut weight = 1.0;
                for (at, other) in links.of(cell) {
                    sum += level[other] * links.borders[at];
                    weight += links.borders[at];
                }
                sum / weight
            })
            .collect();
    }
    level
}

/// Luminance around each cell, nowhere below a small fraction of the mean over all.
fn levels(values: &[Vec3], links: &Links) -> Vec<f32> {
    let around: Vec<f32> = levelled(values, links)
        .iter()
        .map(|v| luminance(*v))
        .collect();
    let least = (mean(&around) * MIN_LEVEL).max(f32::MIN_POSITIVE.sqrt());
    around.iter().map(|l| l.max(least)).collect()
}
