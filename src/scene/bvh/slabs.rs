//! Intersection of a ray with the eight boxes of a node.

use crate::scene::bvh::lanes::{Lanes, splat};
use crate::scene::bvh::{Node, WIDTH};
use crate::scene::geometry::Ray;
use glam::{Vec3, Vec3A};

/// A ray, precomputed for the slab test.
pub(super) struct Slabs<L> {
    origin: [L; 3],
    inverse: [L; 3],
    /// The reciprocals, enlarged by the rounding error of slab distances.
    inverse_far: [L; 3],
    /// For each axis, the row of `Node` with the near plane.
    near: [usize; 3],
    t_min: L,
}

impl<L: Lanes<WIDTH>> Slabs<L> {
    /// `inverse` is the [`reciprocal`] of the ray's direction.
    #[inline(always)]
    pub fn new(ray: &Ray, inverse: Vec3A) -> Self {
        // Slab distances have at most three rounding errors (PBR 4ed, 6.1.2); widen the far distance by more.
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

    /// Distance to a plane of each child box.
    #[inline(always)]
    fn plane(&self, node: &Node, axis: usize, row: usize, inverse: &[L; 3]) -> L {
        L::load(&node.rows[row & 7])
            .sub(self.origin[axis])
            .mul(inverse[axis])
    }

    /// Entry distances of the eight boxes, and the mask of boxes hit before `t_max`.
    #[inline(always)]
    pub fn intersect(&self, node: &Node, t_max: f32) -> (L, u32) {
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

/// The reciprocal of each component of a direction; tiny components are clamped, keeping their sign.
#[inline(always)]
pub(super) fn reciprocal(direction: Vec3) -> Vec3A {
    // Zero components would give 0 · ∞ in the slab test.
    let tiny = Vec3A::splat(direction.abs().max_element() * 1e-24);
    let direction = Vec3A::from(direction);
    let is_tiny = direction.abs().cmplt(tiny);
    Vec3A::select(is_tiny, tiny.copysign(direction), direction).recip()
}
