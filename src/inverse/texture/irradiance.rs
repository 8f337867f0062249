//! The irradiance of cells: traced in two independent sets, then smoothed as much as each set predicts the other best.

use crate::inverse::texture::cells::Cells;
use crate::inverse::texture::coverage::Coverage;
use crate::inverse::texture::fuse::{Problem, fuse, mean, mean_channel};
use crate::inverse::texture::gloss::white_base;
use crate::inverse::texture::links::Links;
use crate::inverse::texture::observations::Observations;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::warp;
use crate::scene::geometry::Hit;
use crate::transport::arrival::RayCount;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// First of the sample keys of these paths, disjoint from those of the fit.
const KEY: u64 = 5 << 59;
/// Averages over neighbours that give the level of a cell.
const AVERAGES: u32 = 40;
/// Least level of a cell, relative to the mean over the object.
const MIN_LEVEL: f32 = 1e-2;
/// Weight of the local mean as a prior, relative to the mean weight of the cells; it makes the system definite.
const PRIOR_WEIGHT: f32 = 1e-5;
/// Strengths of smoothing that are tried, strongest first.
const STRENGTHS: [f32; 9] = [8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.12, 0.06, 0.03];
/// Consecutive worse strengths that end the search.
const PATIENCE: u32 = 2;

/// Radiance of cells along their normals with an albedo of one (irradiance / π; of the base only below a lobe), from two
/// independent sets of paths.
#[derive(Debug, Clone, Default)]
pub struct Irradiance {
    /// One value per cell in each set.
    pub sets: [Vec<Vec3>; 2],
    /// Rays cast, and paths rejected because they were not finite.
    pub cast: RayCount,
}

/// Smoothed irradiance.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// Radiance of each cell with an albedo of one.
    pub radiance: Vec<Vec3>,
    /// Relative standard error, root mean square over cells.
    pub noise: f32,
}

/// Traces `samples` paths per set from random points of each cell in the range: from the points that pixels see, so that the
/// hidden part of a cell counts for nothing, and from all of it if no pixel sees it.
pub fn trace(
    lit: &LitScene,
    cells: &Cells,
    coverage: &Coverage,
    range: Range<usize>,
    samples: u32,
    options: &PathOptions,
    [seed, key]: [u64; 2],
) -> Irradiance {
    let traced: Vec<([Vec3; 2], RayCount)> = range
        .into_par_iter()
        .map(|cell| {
            let mut cast = RayCount::default();
            let sets = [0, 1].map(|set| {
                let mut sum = DVec3::ZERO;
                for sample in 0..samples {
                    let index = KEY + 2 * u64::from(sample) + set;
                    let mut stream = Stream::new(seed, key, cell as u64, index);
                    let (hit, normal) = point_on(lit, cells, coverage, cell, &mut stream);
                    let surface = lit.surface(&hit);
                    let (light, path) = white_base(lit, &surface, normal, &mut stream, options);
                    sum += light.as_dvec3();
                    cast += path;
                }
                (sum / f64::from(samples.max(1))).as_vec3()
            });
            (sets, cast)
        })
        .collect();
    let mut irradiance = Irradiance::default();
    for (sets, cast) in traced {
        for (all, value) in irradiance.sets.iter_mut().zip(sets) {
            all.push(value);
        }
        irradiance.cast += cast;
    }
    irradiance
}

/// A seen point of a cell, or a point uniform in area if none is seen, and the normal of its seen side.
fn point_on(
    lit: &LitScene,
    cells: &Cells,
    coverage: &Coverage,
    cell: usize,
    stream: &mut Stream,
) -> (Hit, Vec3) {
    let choice = stream.uniform();
    let within = warp::uniform_triangle(stream.uniform2());
    let scene = &lit.scene;
    let oriented = |hit: Hit| {
        let normal = scene.normals[hit.triangle as usize];
        let front = cells.front(hit.triangle).unwrap_or(true);
        (hit, if front { normal } else { -normal })
    };
    let count = coverage.count(cell);
    if count > 0 {
        let index = (choice * count as f32) as usize;
        return oriented(coverage.hit(cell, index.min(count - 1)));
    }
    let cell = &cells.cells[cell];
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
    oriented(hit)
}

impl Irradiance {
    /// Appends the following cells.
    pub fn append(&mut self, other: Self) {
        for (all, more) in self.sets.iter_mut().zip(other.sets) {
            all.extend(more);
        }
        self.cast += other.cast;
    }

    /// Smooths with the strength at which each set predicts the other best. `between` is called after each strength.
    ///
    /// # Errors
    /// The error of `between`.
    pub fn smoothed<E>(
        &self,
        links: &Links,
        mut between: impl FnMut() -> Result<(), E>,
    ) -> Result<Smoothed, E> {
        let count = self.sets[0].len();
        let both: Vec<Vec3> = (self.sets[0].iter().zip(&self.sets[1]))
            .map(|(a, b)| (*a + *b) * 0.5)
            .collect();
        let levels = levels(&both, links);
        let each = Observations::one_per_cell(count);
        let weights: Vec<Vec3> = levels.iter().map(|l| Vec3::splat(1.0 / (l * l))).collect();
        let local = local_mean(&both, links);
        let problem = |values| Problem {
            observations: &each,
            weights: &weights,
            values,
            links,
            levels: &levels,
            prior: &local,
            prior_weight: PRIOR_WEIGHT * mean_channel(&weights),
        };
        let squares = |a: &[Vec3], b: &[Vec3]| -> f64 {
            let pairs = a.iter().zip(b).zip(&weights);
            pairs
                .map(|((a, b), w)| f64::from(((*a - *b) * (*a - *b)).dot(*w)))
                .sum()
        };

        // From strong to weak, until the prediction gets worse.
        let mut smooth = [0, 1].map(|s| local_mean(&self.sets[s], links));
        let mut best = (f64::INFINITY, STRENGTHS[0], 0.0);
        let mut worse = 0;
        for strength in STRENGTHS {
            let fused = |s: usize| fuse(&problem(&self.sets[s]), strength, &smooth[s]);
            smooth = rayon::join(|| fused(0), || fused(1)).into();
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
            between()?;
        }

        // The mean of both sets has half the variance of one.
        let strength = best.1 * std::f32::consts::FRAC_1_SQRT_2;
        let start: Vec<Vec3> = (smooth[0].iter().zip(&smooth[1]))
            .map(|(a, b)| (*a + *b) * 0.5)
            .collect();
        Ok(Smoothed {
            radiance: fuse(&problem(&both), strength, &start),
            noise: best.2 as f32,
        })
    }
}

/// A wide local mean by repeated averages over neighbours.
fn local_mean(values: &[Vec3], links: &Links) -> Vec<Vec3> {
    let mut level = values.to_vec();
    for _ in 0..AVERAGES {
        level = (0..level.len())
            .into_par_iter()
            .map(|cell| {
                let mut sum = level[cell];
                let mut weight = 1.0;
                for (at, other) in links.neighbours(cell) {
                    sum += level[other] * links.borders[at];
                    weight += links.borders[at];
                }
                sum / weight
            })
            .collect();
    }
    level
}

/// Luminance of the local mean at each cell, at least [`MIN_LEVEL`] times the mean over all cells.
fn levels(values: &[Vec3], links: &Links) -> Vec<f32> {
    let local: Vec<f32> = local_mean(values, links)
        .iter()
        .map(|v| luminance(*v))
        .collect();
    let min = (mean(&local) * MIN_LEVEL).max(f32::MIN_POSITIVE.sqrt());
    local.iter().map(|l| l.max(min)).collect()
}
