//! Intersection of a ray with the eight boxes of a node, and with the triangles of a group.

use crate::scene::bvh::lanes::{Lanes, splat};
use crate::scene::bvh::{GROUP, Group, Node, WIDTH};
use crate::scene::geometry::{Hit, Ray};
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

/// A ray, precomputed for the triangle test.
pub(super) struct Shear<L> {
    origin: [L; 3],
    /// Axes permuted so that the direction's largest component is last (z).
    axes: [usize; 3],
    /// Shear of x and y, and scale of z, that map the direction to the unit z axis.
    shear: [L; 3],
    t_min: L,
}

impl<L: Lanes<GROUP>> Shear<L> {
    /// `inverse` is the [`reciprocal`] of the ray's direction.
    #[inline(always)]
    pub fn new(ray: &Ray, inverse: Vec3A) -> Self {
        let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
        let size = ray.direction.abs();
        let z = if size.z >= size.x && size.z >= size.y {
            2
        } else {
            usize::from(size.y > size.x)
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let scale = inverse.to_array()[z];
        let shear = [
            direction[axes[0]] * scale,
            direction[axes[1]] * scale,
            scale,
        ];
        Self {
            origin: splat([origin[axes[0]], origin[axes[1]], origin[z]]),
            axes,
            shear: splat(shear),
            t_min: L::splat(ray.t_min),
        }
    }

    /// A corner of each triangle in the sheared space of the ray.
    #[inline(always)]
    fn corner(&self, group: &Group, corner: usize) -> [L; 3] {
        let rows = &group.corners[corner];
        let [kx, ky, kz] = self.axes;
        let x = L::load(&rows[kx & 3]).sub(self.origin[0]);
        let y = L::load(&rows[ky & 3]).sub(self.origin[1]);
        let z = L::load(&rows[kz & 3]).sub(self.origin[2]);
        [
            x.sub(self.shear[0].mul(z)),
            y.sub(self.shear[1].mul(z)),
            self.shear[2].mul(z),
        ]
    }

    /// Intersects the line with a group's triangles beyond `t_min`: hits, t, unnormalised barycentrics v, w and their total.
    ///
    /// Watertight (Woop, Benthin and Wald 2013): the edge function of sheared corners is a difference of two rounded products,
    /// which never has the wrong sign; zero counts as inside.
    #[inline(always)]
    fn cross(&self, group: &Group) -> (u32, L, [L; 3]) {
        let [ax, ay, az] = self.corner(group, 0);
        let [bx, by, bz] = self.corner(group, 1);
        let [cx, cy, cz] = self.corner(group, 2);
        let u = cx.mul(by).sub(cy.mul(bx));
        let v = ax.mul(cy).sub(ay.mul(cx));
        let w = bx.mul(ay).sub(by.mul(ax));

        let zero = L::splat(0.0);
        let inside = zero.le(u.min(v).min(w)) | u.max(v).max(w).le(zero);
        if inside == 0 {
            return (0, zero, [zero; 3]);
        }
        let total = u.add(v).add(w);
        let t = u.mul(az).add(v.mul(bz)).add(w.mul(cz)).div(total);
        (inside & self.t_min.lt(t), t, [v, w, total])
    }

    /// Whether the ray hits any triangle of a group before `t_max`.
    #[inline(always)]
    pub fn hits_any(&self, group: &Group, t_max: f32) -> bool {
        let (crossed, t, _) = self.cross(group);
        crossed & t.lt(L::splat(t_max)) != 0
    }

    /// Updates `nearest` with the hits of a group's triangles.
    #[inline(always)]
    pub fn nearest(&self, group: &Group, nearest: &mut Hit) {
        let (crossed, t, [v, w, total]) = self.cross(group);
        let mut candidates = crossed & t.le(L::splat(nearest.t));
        if candidates == 0 {
            return;
        }

        // Ties go to the lowest index; a hit at t_max itself does not count.
        let (t, v, w, total) = (t.store(), v.store(), w.store(), total.store());
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize & (GROUP - 1);
            candidates &= candidates - 1;
            let triangle = group.triangle(lane);
            let tied =
                t[lane] == nearest.t && triangle < nearest.triangle && nearest.triangle != u32::MAX;
            if t[lane] < nearest.t || tied {
                *nearest = Hit {
                    t: t[lane],
                    triangle,
                    b1: v[lane] / total[lane],
                    b2: w[lane] / total[lane],
                };
            }
        }
    }
}
