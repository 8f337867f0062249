//! Single photographs that have another's pose.
//!
//! A low score alone says little, since a sound photograph of a plain wall has one too. So a photograph is named only where
//! another pose or another photograph contradicts it.

use crate::calibrate::alignment::edges::{Edges, edges};
use crate::calibrate::alignment::score::levels;
use crate::calibrate::alignment::{AGREES, LONG_SIDE, MAX_FRAMES, Views, plainly_better};
use crate::capture::orientation::Orientation;
use crate::math::stats::quantile;

/// Pictures from one pose are alike if they share half of the variance of their brightness: other exposures, noise and passers-by
/// leave more than that.
const ALIKE: f64 = 0.5;

/// A photograph that does not show what its pose sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Astray {
    /// Its frame.
    pub frame: usize,
    /// What tells.
    pub why: Why,
}

/// What tells that a photograph does not show what its pose sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// It shows what the pose of another frame sees.
    Shows(usize),
    /// It has the pose of another frame, whose photograph is another picture and fits the mesh better.
    Fractions(usize),
}

/// The photographs that are astray where most others plainly are not, given the scores of those that are compared.
pub(super) fn astray(views: &Views, scores: &[f64]) -> Vec<Astray> {
    let usual = quantile(&mut scores.to_vec(), 0.5);
    if usual.is_none_or(|usual| usual < AGREES) {
        return Vec::new();
    }
    let frames = views.chosen(MAX_FRAMES);
    let low: Vec<usize> = (0..frames.len()).filter(|&i| scores[i] < AGREES).collect();
    if low.is_empty() {
        return Vec::new();
    }
    let seen: Vec<Edges> = (frames.iter())
        .map(|&frame| edges(views.scene, &views.scene.cameras[frame].shrunk(LONG_SIDE)))
        .collect();
    let why = |i: usize| {
        let others = || (0..frames.len()).filter(|&k| k != i);
        let plainly_above = |score: f64| plainly_better(&[score], &[scores[i]]);
        let shown = others()
            .map(|k| (k, score_at(views, frames[i], frames[k], &seen[k])))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|&(_, score)| plainly_above(score));
        let shared = || {
            others().find(|&k| {
                scores[k] >= AGREES
                    && same_pose(views, frames[i], frames[k])
                    && (plainly_above(scores[k]) || !alike(views, frames[i], frames[k]))
            })
        };
        // What is fitted better where the pose is the same is no other pose.
        match shown.filter(|&(k, _)| !same_pose(views, frames[i], frames[k])) {
            Some((k, _)) => Some(Why::Shows(frames[k])),
            None => shared().map(|k| Why::Fractions(frames[k])),
        }
    };
    (low.into_iter())
        .filter_map(|i| {
            Some(Astray {
                frame: frames[i],
                why: why(i)?,
            })
        })
        .collect()
}

/// The score of a frame's photograph at the pose of another one.
fn score_at(views: &Views, photograph: usize, pose: usize, seen: &Edges) -> f64 {
    let camera = views.scene.cameras[pose].shrunk(LONG_SIDE);
    (views.contrast(photograph, Orientation::default(), &camera)).score(seen)
}

fn same_pose(views: &Views, a: usize, b: usize) -> bool {
    let [a, b] = [a, b].map(|frame| &views.scene.cameras[frame]);
    (a.rotation, a.center) == (b.rotation, b.center) && a.intrinsics == b.intrinsics
}

/// Whether two photographs from one pose are the same picture, whatever their exposures and noise.
fn alike(views: &Views, a: usize, b: usize) -> bool {
    let lens = views.scene.cameras[a].shrunk(LONG_SIDE).intrinsics;
    let [a, b] =
        [a, b].map(|frame| ranks(&levels(&views.photographs[frame], lens.width, lens.height)));
    let correlation = correlation(&a, &b);
    correlation > 0.0 && correlation.powi(2) >= ALIKE
}

/// Each value's place among all of them.
fn ranks(values: &[f32]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for (place, &index) in order.iter().enumerate() {
        ranks[index] = place as f64;
    }
    ranks
}

/// The correlation of two lists of ranks of the same length.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| -> f64 {
        let both = a.iter().zip(b);
        both.map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    product(a, b) / product(a, a).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_correlate_whatever_the_curve_between_values() {
        let values = [0.3f32, 0.1, 0.9, 0.5, 0.7];
        let squared = values.map(|v| v * v);
        let turned = values.map(|v| -v);
        assert_eq!(ranks(&values), [1.0, 0.0, 4.0, 2.0, 3.0]);
        assert_eq!(correlation(&ranks(&values), &ranks(&squared)), 1.0);
        assert_eq!(correlation(&ranks(&values), &ranks(&turned)), -1.0);
        assert_eq!(correlation(&[], &[]), 0.0);
    }
}
