//! Exposure and white balance of each photograph, where the photographs disagree about surfaces that they share.
//!
//! What a pixel shows is its surface's radiance times its photograph's exposure, one factor a channel. On surface cells
//! that several photographs see, the logarithms are fitted by the median in turns over cells and photographs, so that
//! highlights, mis-registration and people decide nothing. One common factor stays open; by convention the exposures'
//! geometric mean is 1.

use crate::capture::photograph::Photograph;
use crate::inverse::measured::cell_key;
use crate::inverse::solver::Problem;
use crate::inverse::survey::Survey;
use crate::math::stats::quantile;
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Width of a surface cell in pixel footprints.
const CELL_FOOTPRINTS: f32 = 4.0;
/// Turns of the fit at most, and the change of a logarithm that ends it.
const TURNS: usize = 100;
const STANDING: f64 = 1e-3;
/// Cells that a photograph must share with others, for its exposure to be told.
const LEAST_CELLS: usize = 30;
/// Share of the disagreement on cells left out of the fit that exposures must explain.
const LEAST_GAIN: f64 = 0.05;
/// Pixels above this share of saturation may have been brighter than they show.
const BELOW_SATURATION: f32 = 0.97;
/// Pixels darker than this share of the photographs' median level hold mostly noise.
const ABOVE_NOISE: f64 = 0.1;

/// What was found out about exposures.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposures {
    /// For each photograph and channel, its pixels over the radiance.
    pub factors: Vec<Vec3>,
    /// Share of the disagreement, on surfaces left out of the fit, that they explain.
    pub gain: f64,
    /// Whether that is enough for them to be taken.
    pub needed: bool,
}

/// The mean logarithm of what one photograph shows of one surface cell.
#[derive(Debug, Clone, Copy)]
struct Sight {
    frame: usize,
    cell: usize,
    level: DVec3,
}

impl Exposures {
    /// Compares the photographs on the surfaces that they share, held-out pixels left out; `None` where too few are
    /// shared to tell.
    pub fn new(problem: &Problem, survey: &Survey) -> Option<Self> {
        let frames = problem.photographs.len();
        let sights = sights(problem, survey);
        // Exposures of one half of the cells are tried on the other.
        let (fitted, tested): (Vec<Sight>, Vec<Sight>) =
            sights.iter().partition(|s| s.cell.is_multiple_of(2));
        let half = fit(&fitted, frames);
        let before = disagreement(&tested, &vec![DVec3::ZERO; frames])?;
        let after = disagreement(&tested, &half)?;
        let gain = if before > 0.0 {
            1.0 - after / before
        } else {
            0.0
        };
        let logarithms = fit(&sights, frames);
        Some(Self {
            factors: (logarithms.iter()).map(|l| l.exp().as_vec3()).collect(),
            gain,
            needed: gain > LEAST_GAIN,
        })
    }

    /// The largest and the least factor, of the mean over channels.
    pub fn range(&self) -> (f32, f32) {
        let means = self.factors.iter().map(|f| f.element_sum() / 3.0);
        means.fold((f32::INFINITY, 0.0), |(low, high), m| {
            (low.min(m), high.max(m))
        })
    }

    /// The problem as photographs of equal exposure show it.
    pub fn undone(&self, problem: &Problem) -> Problem {
        let photographs = (problem.photographs.iter().zip(&self.factors))
            .map(|(photograph, factor)| {
                Arc::new(Photograph {
                    pixels: photograph.pixels.iter().map(|p| *p / *factor).collect(),
                    // A channel that was saturated stays above this.
                    saturation: photograph.saturation / factor.max_element(),
                    ..(**photograph).clone()
                })
            })
            .collect();
        Problem {
            photographs,
            ..problem.clone()
        }
    }
}

/// What each photograph shows of the cells that at least two see.
fn sights(problem: &Problem, survey: &Survey) -> Vec<Sight> {
    let size = survey.footprint * CELL_FOOTPRINTS;
    if size <= 0.0 {
        return Vec::new();
    }
    let usable = |p: &&crate::inverse::survey::SurveyedPixel| {
        let photograph = &problem.photographs[p.frame as usize];
        let value = photograph.pixels[p.pixel as usize];
        p.pure && !p.held_out && value.max_element() < photograph.saturation * BELOW_SATURATION
    };
    let mut levels: Vec<f64> = (survey.pixels.iter().filter(usable))
        .map(|p| {
            f64::from(problem.photographs[p.frame as usize].pixels[p.pixel as usize].max_element())
        })
        .collect();
    let least = (quantile(&mut levels, 0.5).unwrap_or(0.0) * ABOVE_NOISE).max(f64::MIN_POSITIVE);

    let mut sums: BTreeMap<(u64, u32), (DVec3, f64)> = BTreeMap::new();
    for pixel in survey.pixels.iter().filter(usable) {
        let value = problem.photographs[pixel.frame as usize].pixels[pixel.pixel as usize];
        if f64::from(value.min_element()) < least {
            continue;
        }
        if let Some(point) = pixel.points.iter().flatten().next() {
            let sum = sums
                .entry((cell_key(size, point), pixel.frame))
                .or_default();
            sum.0 += value.as_dvec3();
            sum.1 += 1.0;
        }
    }
    let all: Vec<((u64, u32), (DVec3, f64))> = sums.into_iter().collect();
    let shared = all
        .chunk_by(|a, b| a.0.0 == b.0.0)
        .filter(|cell| cell.len() > 1);
    shared
        .enumerate()
        .flat_map(|(cell, of_cell)| {
            of_cell.iter().map(move |((_, frame), (sum, count))| Sight {
                frame: *frame as usize,
                cell,
                level: (*sum / *count).map(f64::ln),
            })
        })
        .collect()
}

/// Logarithms of the exposures: medians over cells and over photographs in turns. Zero where too little is shared.
fn fit(sights: &[Sight], frames: usize) -> Vec<DVec3> {
    let mut of_frame: Vec<Vec<usize>> = vec![Vec::new(); frames];
    for (index, sight) in sights.iter().enumerate() {
        of_frame[sight.frame].push(index);
    }
    let told = |frame: usize| of_frame[frame].len() >= LEAST_CELLS;
    let mut exposures = vec![DVec3::ZERO; frames];
    for _ in 0..TURNS {
        let before = exposures.clone();
        let cells = cell_levels(sights, &exposures);
        for frame in (0..frames).filter(|&f| told(f)) {
            exposures[frame] = median(of_frame[frame].iter().map(|&i| sights[i].level - cells[i]));
        }
        let count = (0..frames).filter(|&f| told(f)).count();
        let sum: DVec3 = (0..frames).filter(|&f| told(f)).map(|f| exposures[f]).sum();
        for frame in (0..frames).filter(|&f| told(f)) {
            exposures[frame] -= sum / count as f64;
        }
        let mut changes = exposures.iter().zip(&before).map(|(e, b)| (*e - *b).abs());
        if changes.all(|change| change.max_element() < STANDING) {
            break;
        }
    }
    exposures
}

/// For each sight, the median level of its cell under some exposures.
fn cell_levels(sights: &[Sight], exposures: &[DVec3]) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(sights.len());
    for cell in sights.chunk_by(|a, b| a.cell == b.cell) {
        let level = median(cell.iter().map(|s| s.level - exposures[s.frame]));
        levels.extend(std::iter::repeat_n(level, cell.len()));
    }
    levels
}

/// Mean absolute difference of logarithms between sights and their cells; `None` where nothing is shared.
fn disagreement(sights: &[Sight], exposures: &[DVec3]) -> Option<f64> {
    let cells = cell_levels(sights, exposures);
    let sum: f64 = (sights.iter().zip(&cells))
        .map(|(s, cell)| (s.level - exposures[s.frame] - *cell).abs().element_sum())
        .sum();
    (!sights.is_empty()).then(|| sum / (3.0 * sights.len() as f64))
}

fn median(values: impl Iterator<Item = DVec3>) -> DVec3 {
    let all: Vec<DVec3> = values.collect();
    DVec3::from_array(std::array::from_fn(|channel| {
        let mut values: Vec<f64> = all.iter().map(|v| v[channel]).collect();
        quantile(&mut values, 0.5).unwrap_or(0.0)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Cells of random levels seen by random photographs of given exposures, with some noise and some outliers.
    fn seen(exposures: &[DVec3], noise: f64) -> Vec<Sight> {
        let mut stream = Stream::new(71, 0, 0, 0);
        (0..400)
            .flat_map(|cell| {
                let level = DVec3::splat(f64::from(stream.uniform()) * 3.0);
                let mut own = Vec::new();
                for (frame, exposure) in exposures.iter().enumerate() {
                    if stream.uniform() < 0.5 {
                        let wrong = if stream.uniform() < 0.1 { 1.5 } else { 0.0 };
                        let error = f64::from(stream.uniform() - 0.5) * noise + wrong;
                        own.push(Sight {
                            frame,
                            cell,
                            level: level + *exposure + DVec3::splat(error),
                        });
                    }
                }
                if own.len() > 1 { own } else { Vec::new() }
            })
            .collect()
    }

    #[test]
    fn exposures_are_found_up_to_their_mean_in_spite_of_outliers() {
        let truth: Vec<DVec3> = (0..6)
            .map(|f| DVec3::new(0.1, -0.05, 0.2) * f64::from(f) - DVec3::new(0.25, -0.125, 0.5))
            .collect();
        let found = fit(&seen(&truth, 0.1), 6);
        for (found, truth) in found.iter().zip(&truth) {
            assert!((*found - *truth).length() < 0.03, "{found} {truth}");
        }
    }

    #[test]
    fn a_photograph_that_shares_too_little_keeps_its_exposure() {
        let mut sights = seen(&[DVec3::splat(0.3), DVec3::splat(-0.3)], 0.0);
        sights.push(Sight {
            frame: 2,
            cell: sights.last().map_or(0, |s| s.cell),
            level: DVec3::splat(9.0),
        });
        let found = fit(&sights, 3);
        assert_eq!(found[2], DVec3::ZERO);
        assert!((found[0] - found[1] - DVec3::splat(0.6)).length() < 0.01);
    }

    #[test]
    fn equal_exposures_explain_nothing() {
        let sights = seen(&[DVec3::ZERO; 5], 0.2);
        let found = fit(&sights, 5);
        let before = disagreement(&sights, &[DVec3::ZERO; 5]).expect("cells are shared");
        let after = disagreement(&sights, &found).expect("cells are shared");
        assert!((after / before - 1.0).abs() < 0.02, "{before} {after}");
        assert_eq!(disagreement(&[], &[]), None);
    }
}
