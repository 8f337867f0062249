//! Intersection of a ray with the triangles of a group.

use crate::scene::bvh::lanes::{Lanes, splat};
use crate::scene::bvh::{GROUP, Group};
use crate::scene::geometry::{Hit, Ray};
use glam::Vec3A;

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
    /// `inverse` is the `slabs::reciprocal` of the ray's direction.
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
