//! Closest-hit and any-hit traversal of the eight-wide hierarchy.

use super::lanes;
#[cfg(target_arch = "x86_64")]
use super::lanes::{Eight, Four};
use super::lanes::{Lanes, Portable};
use super::{Bvh, Child, GROUP, Group, InstructionSet, Node, WIDTH};
use crate::scene::geometry::{Hit, Ray};

/// Stack entries kept in the frame; deeper hierarchies take theirs from the heap.
const SHALLOW: usize = 64;

/// A child still to be visited, in the low half, and the bits of where the ray enters its box: ordered by distance.
type Entry = u64;

#[inline(always)]
fn entry(child: Child, t: f32) -> Entry {
    u64::from(t.to_bits()) << 32 | u64::from(child.0)
}

#[inline]
pub(super) fn intersect(bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    let nearest = dispatch(bvh, ray, false);
    (nearest.triangle != u32::MAX).then_some(nearest)
}

#[inline]
pub(super) fn occluded(bvh: &Bvh, ray: &Ray) -> bool {
    let nearest = dispatch(bvh, ray, true);
    nearest.triangle != u32::MAX
}

#[inline]
fn dispatch(bvh: &Bvh, ray: &Ray, any: bool) -> Hit {
    match (bvh.instructions, any) {
        // SAFETY: `Bvh::instructions` is at most what `InstructionSet::widest` detected.
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx512, false) => unsafe { avx512::<false>(bvh, ray) },
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx512, true) => unsafe { avx512::<true>(bvh, ray) },
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx2, false) => unsafe { avx2::<false>(bvh, ray) },
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx2, true) => unsafe { avx2::<true>(bvh, ray) },
        (_, false) => with_stack::<Portable<WIDTH>, Portable<GROUP>, false>(bvh, ray),
        (_, true) => with_stack::<Portable<WIDTH>, Portable<GROUP>, true>(bvh, ray),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,bmi1,bmi2,lzcnt")]
fn avx512<const ANY: bool>(bvh: &Bvh, ray: &Ray) -> Hit {
    with_stack::<Eight, Four, ANY>(bvh, ray)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn avx2<const ANY: bool>(bvh: &Bvh, ray: &Ray) -> Hit {
    with_stack::<Eight, Four, ANY>(bvh, ray)
}

#[inline(always)]
fn with_stack<B: Lanes<WIDTH>, T: Lanes<GROUP>, const ANY: bool>(bvh: &Bvh, ray: &Ray) -> Hit {
    if bvh.stack_size <= SHALLOW {
        traverse::<B, T, ANY>(bvh, ray, &mut [0; SHALLOW])
    } else {
        traverse::<B, T, ANY>(bvh, ray, &mut vec![0; bvh.stack_size])
    }
}

/// A ray as the box test wants it.
struct Slabs<L> {
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
    fn new(ray: &Ray) -> Self {
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
    fn meet(&self, node: &Node, t_max: f32) -> (L, u32) {
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

#[inline(always)]
fn splat<const N: usize, L: Lanes<N>>([x, y, z]: [f32; 3]) -> [L; 3] {
    [L::splat(x), L::splat(y), L::splat(z)]
}

/// A ray as the triangle test wants it.
struct Shear<L> {
    origin: [L; 3],
    /// The axes in the order in which the ray is a z axis: its largest component last.
    axes: [usize; 3],
    /// Shear of x and y, and scale of z, that turn the ray into the unit z axis.
    shear: [L; 3],
    t_min: L,
}

impl<L: Lanes<GROUP>> Shear<L> {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
        let size = ray.direction.abs();
        let z = if size.z >= size.x && size.z >= size.y {
            2
        } else {
            usize::from(size.y > size.x)
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let scale = 1.0 / direction[z];
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

    /// A corner of each triangle, sheared onto the ray.
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

    /// Tests a group of triangles and keeps the nearest hit; returns whether there was any.
    ///
    /// Watertight (Woop, Benthin and Wald 2013): corners are sheared onto the ray first, and a difference of two
    /// rounded products never has the wrong sign, at worst it is zero, which counts as inside.
    #[inline(always)]
    fn meet<const ANY: bool>(&self, group: &Group, nearest: &mut Hit) -> bool {
        let [ax, ay, az] = self.corner(group, 0);
        let [bx, by, bz] = self.corner(group, 1);
        let [cx, cy, cz] = self.corner(group, 2);
        let u = cx.mul(by).sub(cy.mul(bx));
        let v = ax.mul(cy).sub(ay.mul(cx));
        let w = bx.mul(ay).sub(by.mul(ax));

        let zero = L::splat(0.0);
        let inside = zero.le(u.min(v).min(w)) | u.max(v).max(w).le(zero);
        if inside == 0 {
            return false;
        }
        let total = u.add(v).add(w);
        let t = u.mul(az).add(v.mul(bz)).add(w.mul(cz)).div(total);
        let mut candidates = inside & self.t_min.lt(t);
        if ANY {
            return candidates & t.lt(L::splat(nearest.t)) != 0;
        }
        candidates &= t.le(L::splat(nearest.t));
        if candidates == 0 {
            return false;
        }

        // Of equally near triangles the lowest index wins; t_max itself is outside.
        let (t, v, w, total) = (t.store(), v.store(), w.store(), total.store());
        let mut met = false;
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
                met = true;
            }
        }
        met
    }
}

#[inline(always)]
fn traverse<B: Lanes<WIDTH>, T: Lanes<GROUP>, const ANY: bool>(
    bvh: &Bvh,
    ray: &Ray,
    stack: &mut [Entry],
) -> Hit {
    let mut nearest = Hit {
        t: ray.t_max,
        triangle: u32::MAX,
        b1: 0.0,
        b2: 0.0,
    };
    let (nodes, groups): (&[Node], &[Group]) = (&bvh.nodes, &bvh.groups);
    if nodes.is_empty() {
        return nearest;
    }
    let slabs = Slabs::<B>::new(ray);
    let shear = Shear::<T>::new(ray);
    let mut depth = 0;
    let mut current = Child::inner(0);
    loop {
        // Descend to the nearest child, leaving the others on the stack.
        while !current.is_leaf() {
            let node = &nodes[current.0 as usize];
            let (near, mut mask) = slabs.meet(node, nearest.t);
            if mask == 0 {
                current = Child::EMPTY;
                break;
            }
            let first = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            if mask == 0 {
                current = node.child(first);
                continue;
            }
            if ANY {
                // Any order will do.
                current = node.child(first);
                while mask != 0 {
                    let lane = mask.ilog2();
                    mask ^= 1 << lane;
                    let child = node.child(lane as usize);
                    prefetch(nodes, groups, child);
                    stack[depth] = u64::from(child.0);
                    depth += 1;
                }
                continue;
            }
            let second = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let t = near.store();
            let of = |lane: usize| entry(node.child(lane), t[lane & (WIDTH - 1)]);
            let (a, b) = (of(first), of(second));
            prefetch(nodes, groups, node.child(first));
            prefetch(nodes, groups, node.child(second));
            let (mut best, mut rest) = (a.min(b), a.max(b));
            let base = depth;
            while mask != 0 {
                // Insert so that the nearest lies on top.
                let next = of(mask.trailing_zeros() as usize);
                prefetch(nodes, groups, node.child(mask.trailing_zeros() as usize));
                mask &= mask - 1;
                let mut place = depth;
                while place > base && stack[place - 1] < rest {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = rest;
                depth += 1;
                (best, rest) = (best.min(next), best.max(next));
            }
            let mut place = depth;
            while place > base && stack[place - 1] < rest {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = rest;
            depth += 1;
            current = Child(best as u32);
        }

        // Test the triangles of a leaf.
        if current != Child::EMPTY {
            for group in &groups[current.groups()] {
                if shear.meet::<ANY>(group, &mut nearest) && ANY {
                    nearest.triangle = 0;
                    return nearest;
                }
            }
        }

        // Take the next child that is still near enough.
        loop {
            if depth == 0 {
                return nearest;
            }
            depth -= 1;
            let next = stack[depth];
            if ANY || f32::from_bits((next >> 32) as u32) <= nearest.t {
                current = Child(next as u32);
                break;
            }
        }
    }
}

/// Asks for the memory of a child that will soon be visited.
#[inline(always)]
fn prefetch(nodes: &[Node], groups: &[Group], child: Child) {
    if child.is_leaf() {
        lanes::prefetch(groups.as_ptr().wrapping_add(child.groups().start));
    } else {
        lanes::prefetch(nodes.as_ptr().wrapping_add(child.0 as usize));
    }
}
