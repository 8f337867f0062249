//! Emitter sampling: an object from a Fenwick tree of weights, then a point uniformly by area.

use crate::math::color::luminance;
use crate::math::cumulative::Cumulative;
use crate::math::warp;
use crate::scene::{Object, Scene};
use glam::Vec3;

/// Binary indexed tree over non-negative weights (Fenwick 1994), with logarithmic sampling and updates.
///
/// An update recomputes nodes from their children instead of adding a difference, so that sums do not drift.
#[derive(Debug, Clone, Default)]
pub struct FenwickTree {
    weights: Vec<f64>,
    /// Node i (from 1) holds the sum of the lowbit(i) weights that end at i.
    nodes: Vec<f64>,
}

impl FenwickTree {
    /// The tree of the given weights; negative and non-finite weights count as zero.
    pub fn new(weights: &[f64]) -> Self {
        let weights: Vec<f64> = weights.iter().map(|&w| usable(w)).collect();
        let mut tree = Self {
            nodes: vec![0.0; weights.len() + 1],
            weights,
        };
        for i in 1..tree.nodes.len() {
            tree.recompute(i);
        }
        tree
    }

    /// Sum of all weights.
    pub fn total(&self) -> f64 {
        let (mut sum, mut i) = (0.0, self.weights.len());
        while i > 0 {
            sum += self.nodes[i];
            i &= i - 1;
        }
        sum
    }

    /// Replaces one weight.
    pub fn set(&mut self, index: usize, weight: f64) {
        self.weights[index] = usable(weight);
        let mut i = index + 1;
        while i < self.nodes.len() {
            self.recompute(i);
            i += lowbit(i);
        }
    }

    /// Probability of drawing an index; zero where all weights are zero.
    pub fn probability(&self, index: usize) -> f64 {
        let total = self.total();
        if total > 0.0 {
            self.weights[index] / total
        } else {
            0.0
        }
    }

    /// Samples an index in proportion to its weight from `u` in [0, 1); `None` if all weights are zero.
    pub fn sample(&self, u: f64) -> Option<usize> {
        let mut rest = u * self.total();
        let n = self.weights.len();
        let mut position = 0;
        let mut step = n.checked_ilog2().map_or(0, |bits| 1 << bits);
        while step > 0 {
            if position + step <= n && self.nodes[position + step] <= rest {
                position += step;
                rest -= self.nodes[position];
            }
            step >>= 1;
        }
        // Rounding of prefix sums may lead to a neighbour with zero weight.
        let start = position.min(n.checked_sub(1)?);
        let drawable = |&i: &usize| self.weights[i] > 0.0;
        let before = (0..=start).rev().find(drawable);
        before.or_else(|| (start..n).find(drawable))
    }

    fn recompute(&mut self, i: usize) {
        let mut sum = self.weights[i - 1];
        let mut step = 1;
        while step < lowbit(i) {
            sum += self.nodes[i - step];
            step <<= 1;
        }
        self.nodes[i] = sum;
    }
}

fn lowbit(i: usize) -> usize {
    i & i.wrapping_neg()
}

fn usable(weight: f64) -> f64 {
    if weight.is_finite() && weight > 0.0 {
        weight
    } else {
        0.0
    }
}

/// Area × luminance of emission of each object: the weights of light sampling.
pub fn powers(scene: &Scene, emission: impl Iterator<Item = Vec3>) -> Vec<f64> {
    (scene.objects.iter().zip(emission))
        .map(|(object, emission)| object.area * f64::from(luminance(emission)))
        .collect()
}

/// A point sampled on an object.
#[derive(Debug, Clone, Copy)]
pub struct AreaSample {
    /// Triangle index.
    pub triangle: u32,
    /// Position.
    pub point: Vec3,
}

/// Samples an emitter in proportion to a weight per object, then a point on it uniformly by area.
#[derive(Debug, Clone)]
pub struct Emitters {
    tree: FenwickTree,
    /// For each object, the areas of its triangles in m².
    areas: Vec<Cumulative>,
}

impl Emitters {
    /// Emitters of a scene with one weight per object (in the paper: area × luminance of emission).
    pub fn new(scene: &Scene, weights: &[f64]) -> Self {
        let area = |&triangle: &u32| f64::from(scene.areas[triangle as usize]);
        let areas = |object: &Object| Cumulative::new(object.triangles.iter().map(area));
        Self {
            tree: FenwickTree::new(weights),
            areas: scene.objects.iter().map(areas).collect(),
        }
    }

    /// Replaces the weight of one object.
    pub fn set_weight(&mut self, object: usize, weight: f64) {
        self.tree.set(object, weight);
    }

    /// Whether all weights are zero.
    pub fn is_dark(&self) -> bool {
        self.tree.total() <= 0.0
    }

    /// Probability of drawing an object.
    pub fn probability(&self, object: usize) -> f64 {
        self.tree.probability(object)
    }

    /// Pdf per square metre of a point on an object, including the choice of object.
    #[inline]
    pub fn pdf(&self, object: u32) -> f32 {
        let index = object as usize;
        match self.areas[index].total() {
            area if area > 0.0 => (self.tree.probability(index) / area) as f32,
            _ => 0.0,
        }
    }

    /// Samples an object and a point on it; `None` if all weights are zero.
    ///
    /// The lowest bits of `choice` extend the 24 bits of `u[0]`, so that even very small triangles have the right probability.
    pub fn sample(&self, scene: &Scene, choice: f64, u: [f32; 2]) -> Option<(u32, AreaSample)> {
        let object = self.tree.sample(choice)?;
        // u[0] selects the triangle and is rescaled.
        let areas = &self.areas[object];
        let low_bits = (choice * (1u64 << 29) as f64).fract() / f64::from(1 << 24);
        let target = (f64::from(u[0]) + low_bits) * areas.total();
        let index = areas.index_at(target)?;
        let low = areas.before(index);
        let size = areas.sums()[index] - low;
        let within = if size > 0.0 {
            ((target - low) / size) as f32
        } else {
            0.0
        };
        let triangle = scene.objects[object].triangles[index];
        let [b1, b2] = warp::uniform_triangle([within.clamp(0.0, 1.0), u[1]]);
        let [a, b, c] = scene.corners(triangle);
        let point = a * (1.0 - b1 - b2) + b * b1 + c * b2;
        Some((object as u32, AreaSample { triangle, point }))
    }
}
