//! A ray against the eight boxes of a node.

use crate::scene::bvh::lanes::{Lanes, splat};
use crate::scene::bvh::{Node, WIDTH};
use crate::scene::geometry::Ray;
use glam::{Vec3, Vec3A};

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
    /// `inverse` is the [`reciprocal`] of the ray's direction.
    #[inline(always)]
    pub fn new(ray: &Ray, inverse: Vec3A) -> Self {
        // Slab distances are off by at most three roundings (pbrt 4ed, 6.1.2): widen the far side by more.
        const WIDEN: f32 = 1.0 + 8.0 * f32::EPSILON;
        let negative = inverse.is_negative_bitmask() as usize;
        Self {
            origin: splat(ray.origin.to_array()),
            inverse: splat(inverse.to_array()),
            inverse_far: splat((inverse * WIDEN).to_array()),
            near: [
                negative & 1,
                2 + (negative >> 1 & 1),
                4 + (negative >> 2 & 1),
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

/// One over each component of a direction; where one is next to nothing, something huge of its sign.
#[inline(always)]
pub(super) fn reciprocal(direction: Vec3) -> Vec3A {
    // A zero component would make 0 · ∞; a tiny one gives slabs that are as good as parallel.
    let tiny = Vec3A::splat(direction.abs().max_element() * 1e-24);
    let direction = Vec3A::from(direction);
    let is_tiny = direction.abs().cmplt(tiny);
    Vec3A::select(is_tiny, tiny.copysign(direction), direction).recip()
}
