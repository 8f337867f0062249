//! Finds single photographs that are paired with the wrong pose.
//!
//! A low edge score is no proof: a correct photograph of a plain wall has one too. A photograph is reported only if it fits
//! another frame's pose, or if another photograph fits its pose.

use crate::calibrate::alignment::edges::{Edges, edges};
use crate::calibrate::alignment::score::levels;
use crate::calibrate::alignment::{AGREES, LONG_SIDE, MAX_FRAMES, Views, clearly_better};
use crate::capture::orientation::Orientation;
use crate::math::stats::quantile;

/// Least squared rank correlation of two photographs from one pose. Changes of exposure, noise and passers-by leave more.
const SAME_PICTURE: f64 = 0.5;

/// A photograph that does not show the view of its pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MispairedPhotograph {
    /// Frame index.
    pub frame: usize,
    /// Why it is reported.
    pub evidence: Evidence,
}

/// Why a photograph does not belong to its pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evidence {
    /// It shows the view of this other frame's pose.
    ShowsViewOf(usize),
    /// It has the same pose as this other frame, whose photograph is a different picture that fits the mesh better.
    SharesPoseWith(usize),
}

/// The mispaired photographs, given the scores of the compared frames; none unless the median score agrees with the mesh.
pub(super) fn mispaired(views: &Views, scores: &[f64]) -> Vec<MispairedPhotograph> {
    let median = quantile(&mut scores.to_vec(), 0.5);
    if median.is_none_or(|median| median < AGREES) {
        return Vec::new();
    }
    let frames = views.chosen(MAX_FRAMES);
    let low: Vec<usize> = (0..frames.len()).filter(|&i| scores[i] < AGREES).collect();
    if low.is_empty() {
        return Vec::new();
    }
    let mesh_edges: Vec<Edges> = (frames.iter())
        .map(|&frame| edges(views.scene, &views.scene.cameras[frame].shrunk(LONG_SIDE)))
        .collect();
    let evidence = |i: usize| {
        let others = || (0..frames.len()).filter(|&k| k != i);
        let clearly_above = |score: f64| clearly_better(&[score], &[scores[i]]);
        let best_view = others()
            .map(|k| (k, score_at(views, frames[i], frames[k], &mesh_edges[k])))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|&(_, score)| clearly_above(score));
        let shared_pose = || {
            others().find(|&k| {
                scores[k] >= AGREES
                    && same_pose(views, frames[i], frames[k])
                    && (clearly_above(scores[k]) || !same_picture(views, frames[i], frames[k]))
            })
        };
        match best_view.filter(|&(k, _)| !same_pose(views, frames[i], frames[k])) {
            Some((k, _)) => Some(Evidence::ShowsViewOf(frames[k])),
            None => shared_pose().map(|k| Evidence::SharesPoseWith(frames[k])),
        }
    };
    (low.into_iter())
        .filter_map(|i| {
            Some(MispairedPhotograph {
                frame: frames[i],
                evidence: evidence(i)?,
            })
        })
        .collect()
}

/// The score of one frame's photograph at another frame's pose, which sees `edges` of the mesh.
fn score_at(views: &Views, photograph: usize, pose: usize, edges: &Edges) -> f64 {
    let camera = views.scene.cameras[pose].shrunk(LONG_SIDE);
    (views.contrast(photograph, Orientation::default(), &camera)).score(edges)
}

fn same_pose(views: &Views, a: usize, b: usize) -> bool {
    let [a, b] = [a, b].map(|frame| &views.scene.cameras[frame]);
    (a.rotation, a.center) == (b.rotation, b.center) && a.intrinsics == b.intrinsics
}

/// Whether two photographs from one pose show the same picture, up to exposure and noise.
fn same_picture(views: &Views, a: usize, b: usize) -> bool {
    let lens = views.scene.cameras[a].shrunk(LONG_SIDE).intrinsics;
    let [a, b] =
        [a, b].map(|frame| ranks(&levels(&views.photographs[frame], lens.width, lens.height)));
    let correlation = correlation(&a, &b);
    correlation > 0.0 && correlation.powi(2) >= SAME_PICTURE
}

/// The rank of each value, from 0.
fn ranks(values: &[f32]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for (rank, &index) in order.iter().enumerate() {
        ranks[index] = rank as f64;
    }
    ranks
}

/// Pearson correlation of two rankings of the same length (Spearman's correlation of the values).
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| -> f64 {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
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
