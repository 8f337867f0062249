//! Closest-hit and any-hit traversal of the eight-wide hierarchy.

#[cfg(target_arch = "x86_64")]
use super::lanes::Avx2;
use super::lanes::{Lanes, Portable};
use super::{Bvh, Child, Group, InstructionSet, Node, WIDTH};
use crate::scene::geometry::{Hit, Ray};

/// Stack entries kept in the frame; deeper hierarchies take theirs from the heap.
const SHALLOW: usize = 96;

/// A child still to be visited and where the ray enters its box.
#[derive(Clone, Copy)]
struct Entry {
    child: Child,
    t: f32,
}

const NOWHERE: Entry = Entry {
    child: Child::EMPTY,
    t: f32::INFINITY,
};

#[inline]
pub(super) fn intersect(bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    let mut nearest = Hit {
        t: ray.t_max,
        triangle: u32::MAX,
        b1: 0.0,
        b2: 0.0,
    };
    dispatch(bvh, ray, &mut nearest, false);
    (nearest.triangle != u32::MAX).then_some(nearest)
}

#[inline]
pub(super) fn occluded(bvh: &Bvh, ray: &Ray) -> bool {
    let mut nearest = Hit {
        t: ray.t_max,
        triangle: u32::MAX,
        b1: 0.0,
        b2: 0.0,
    };
    dispatch(bvh, ray, &mut nearest, true);
    nearest.triangle != u32::MAX
}

#[inline]
fn dispatch(bvh: &Bvh, ray: &Ray, nearest: &mut Hit, any: bool) {
    match (bvh.instructions, any) {
        // SAFETY: `Bvh::instructions` is `Avx2` only where `InstructionSet::widest` detected AVX2.
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx2, false) => unsafe { avx2::<false>(bvh, ray, nearest) },
        #[cfg(target_arch = "x86_64")]
        (InstructionSet::Avx2, true) => unsafe { avx2::<true>(bvh, ray, nearest) },
        (_, false) => with_stack::<Portable, false>(bvh, ray, nearest),
        (_, true) => with_stack::<Portable, true>(bvh, ray, nearest),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<const ANY: bool>(bvh: &Bvh, ray: &Ray, nearest: &mut Hit) {
    with_stack::<Avx2, ANY>(bvh, ray, nearest);
}

#[inline(always)]
fn with_stack<L: Lanes, const ANY: bool>(bvh: &Bvh, ray: &Ray, nearest: &mut Hit) {
    if bvh.stack_size <= SHALLOW {
        traverse::<L, ANY>(bvh, ray, nearest, &mut [NOWHERE; SHALLOW]);
    } else {
        traverse::<L, ANY>(bvh, ray, nearest, &mut vec![NOWHERE; bvh.stack_size]);
    }
}

/// A ray as the box and triangle tests want it.
struct RayLanes<L> {
    origin: [L; 3],
    inverse: [L; 3],
    /// For each axis, the row of `Node::planes` that the ray meets first.
    near: [usize; 3],
    t_min: L,
    /// The axes in the order in which the ray is a z axis: its largest component last.
    axes: [usize; 3],
    /// Shear of x and y, and scale of z, that turn the ray into the unit z axis.
    shear: [L; 3],
}

impl<L: Lanes> RayLanes<L> {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        let direction = ray.direction.to_array();
        // A zero component would make 0 · ∞; a tiny one gives slabs that are as good as parallel.
        let size = ray.direction.abs();
        let tiny = size.max_element() * 1e-24;
        let inverse = direction.map(|d| 1.0 / if d.abs() < tiny { tiny.copysign(d) } else { d });
        let near = std::array::from_fn(|axis| 2 * axis + usize::from(inverse[axis] < 0.0));
        let z = if size.z >= size.x && size.z >= size.y {
            2
        } else {
            usize::from(size.y > size.x)
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = [
            direction[axes[0]] / direction[z],
            direction[axes[1]] / direction[z],
            1.0 / direction[z],
        ];
        Self {
            origin: ray.origin.to_array().map(L::splat),
            inverse: inverse.map(L::splat),
            near,
            t_min: L::splat(ray.t_min),
            axes,
            shear: shear.map(L::splat),
        }
    }

    /// Distances at which the ray enters the eight boxes, and the boxes that it meets before `t_max`.
    #[inline(always)]
    fn meet_boxes(&self, node: &Node, t_max: f32) -> (L, u32) {
        // Slab distances are off by at most three roundings (pbrt 4ed, 6.1.2): widen the far side by more.
        const WIDEN: f32 = 1.0 + 8.0 * f32::EPSILON;
        let plane = |axis: usize, row: usize| {
            L::load(&node.planes[row])
                .sub(self.origin[axis])
                .mul(self.inverse[axis])
        };
        let near = plane(0, self.near[0])
            .max(plane(1, self.near[1]))
            .max(plane(2, self.near[2]).max(self.t_min));
        let far = plane(0, self.near[0] ^ 1)
            .min(plane(1, self.near[1] ^ 1))
            .min(plane(2, self.near[2] ^ 1))
            .mul(L::splat(WIDEN))
            .min(L::splat(t_max));
        (near, near.le(far))
    }

    /// Tests eight triangles and keeps the nearest hit; returns whether there was any.
    ///
    /// Watertight (Woop, Benthin and Wald 2013): corners are sheared onto the ray first, and a difference of two
    /// rounded products never has the wrong sign, at worst it is zero, which counts as inside.
    #[inline(always)]
    fn meet_triangles(&self, group: &Group, nearest: &mut Hit) -> bool {
        let [kx, ky, kz] = self.axes;
        let sheared = |corner: usize| {
            let along = |axis: usize| L::load(&group.corners[corner][axis]).sub(self.origin[axis]);
            let z = along(kz);
            (
                along(kx).sub(self.shear[0].mul(z)),
                along(ky).sub(self.shear[1].mul(z)),
                self.shear[2].mul(z),
            )
        };
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(0), sheared(1), sheared(2));
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
        let mut candidates = inside & self.t_min.lt(t) & t.le(L::splat(nearest.t));
        if candidates == 0 {
            return false;
        }

        // Of equally near triangles the lowest index wins; t_max itself is outside.
        let (t, v, w, total) = (t.store(), v.store(), w.store(), total.store());
        let mut met = false;
        while candidates != 0 {
            let lane = candidates.trailing_zeros() as usize & (WIDTH - 1);
            candidates &= candidates - 1;
            let triangle = group.triangles[lane];
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
fn traverse<L: Lanes, const ANY: bool>(
    bvh: &Bvh,
    ray: &Ray,
    nearest: &mut Hit,
    stack: &mut [Entry],
) {
    if bvh.nodes.is_empty() {
        return;
    }
    let lanes = RayLanes::<L>::new(ray);
    let mut depth = 0;
    let mut current = Child::inner(0);
    loop {
        // Descend to the nearest child, leaving the others on the stack.
        while !current.is_leaf() {
            let node = &bvh.nodes[current.0 as usize];
            let (near, mut mask) = lanes.meet_boxes(node, nearest.t);
            if mask == 0 {
                current = Child::EMPTY;
                break;
            }
            let first = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            if mask == 0 {
                current = node.children[first & (WIDTH - 1)];
                continue;
            }
            let t = near.store();
            let base = depth;
            let mut best = Entry {
                child: node.children[first & (WIDTH - 1)],
                t: t[first & (WIDTH - 1)],
            };
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & (WIDTH - 1);
                mask &= mask - 1;
                let mut entry = Entry {
                    child: node.children[lane],
                    t: t[lane],
                };
                if entry.t < best.t {
                    std::mem::swap(&mut entry, &mut best);
                }
                // Insert so that the nearest lies on top; any-hit rays do not care.
                let mut place = depth;
                while !ANY && place > base && stack[place - 1].t < entry.t {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = entry;
                depth += 1;
            }
            current = best.child;
        }

        // Test the triangles of a leaf.
        if current != Child::EMPTY {
            for group in &bvh.groups[current.groups()] {
                if lanes.meet_triangles(group, nearest) && ANY {
                    return;
                }
            }
        }

        // Take the next child that is still near enough.
        loop {
            if depth == 0 {
                return;
            }
            depth -= 1;
            if stack[depth].t <= nearest.t {
                current = stack[depth].child;
                break;
            }
        }
    }
}
