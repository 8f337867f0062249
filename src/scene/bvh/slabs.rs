//! A ray against the eight boxes of a node.

use super::lanes::{Lanes, splat};
use super::{Node, WIDTH};
use crate::scene::geometry::Ray;

/// A ray as the box test wants it.
pub(super) struct Slabs<L> {
    origin: [L; 3],
    inverse: [L; 3],
    /// The same, enlarged by the rounding of distances.
    inverse_far: [L; 3],
    /// For each axis, the row of `Node` that the ray meets first.
    near: [usize; 3],
    t_min: L,
}

impl<L: Lanes<WIDTH>> Slabs<L> {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        // A zero component would make 0 · ∞; a tiny one gives slabs that are as good as parallel.
        let tiny = ray.direction.abs().max_element() * 1e-24;
        let [x, y, z] = ray.direction.to_array();
        let inverse = [
            reciprocal(x, tiny),
            reciprocal(y, tiny),
            reciprocal(z, tiny),
        ];
        // Slab distances are off by at most three roundings (pbrt 4ed, 6.1.2): widen the far side by more.
        const WIDEN: f32 = 1.0 + 8.0 * f32::EPSILON;
        Self {
            origin: splat(ray.origin.to_array()),
            inverse: splat(inverse),
            inverse_far: splat(inverse.map(|i| i * WIDEN)),
            near: [
                usize::from(inverse[0] < 0.0),
                2 + usize::from(inverse[1] < 0.0),
                4 + usize::from(inverse[2] < 0.0),
            ],
            t_min: L::splat(ray.t_min),
        }
    }

    /// Distance to each child's plane of an axis.
    #[inline(always)]
    fn plane(&self, node: &Node, axis: usize, row: usize, inverse: &[L; 3]) -> L {
        L::load(&node.rows[row & 7])
            .sub(self.origin[axis])
            .mul(inverse[axis])
    }

    /// Distances at which the ray enters the eight boxes, and the boxes that it meets before `t_max`.
    #[inline(always)]
    pub fn meet(&self, node: &Node, t_max: f32) -> (L, u32) {
        let [x, y, z] = self.near;
        let near = self
            .plane(node, 0, x, &self.inverse)
            .max(self.plane(node, 1, y, &self.inverse))
            .max(self.plane(node, 2, z, &self.inverse).max(self.t_min));
        let far = self
            .plane(node, 0, x ^ 1, &self.inverse_far)
            .min(self.plane(node, 1, y ^ 1, &self.inverse_far))
            .min(
                self.plane(node, 2, z ^ 1, &self.inverse_far)
                    .min(L::splat(t_max)),
            );
        (near, near.le(far))
    }
}

#[inline(always)]
fn reciprocal(d: f32, tiny: f32) -> f32 {
    1.0 / if d.abs() < tiny { tiny.copysign(d) } else { d }
}
