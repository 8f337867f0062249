//! Nearest-hit and any-hit traversal, compiled for each instruction set.

#[cfg(target_arch = "x86_64")]
use crate::scene::bvh::lanes::{Eight, Four};
use crate::scene::bvh::lanes::{Lanes, Portable};
use crate::scene::bvh::ray::{Shear, Slabs, reciprocal};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, InstructionSet, Node, WIDTH, prefetch};
use crate::scene::geometry::{Hit, Ray};
use std::cell::RefCell;

/// Entries of each thread's stacks; deeper hierarchies allocate a stack per ray.
const STACK_SIZE: usize = 128;

thread_local! {
    // Thread-local, since a stack on the call stack would be cleared for every ray.
    static NEAREST: RefCell<[Entry; STACK_SIZE]> = const { RefCell::new([0; STACK_SIZE]) };
    // `Lanes::pack` writes a whole vector at a time.
    static ANY: RefCell<[u32; STACK_SIZE + WIDTH]> = const { RefCell::new([0; STACK_SIZE + WIDTH]) };
}

impl Bvh {
    /// The nearest hit with t in (t_min, t_max).
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        if self.nodes.is_empty() {
            return None;
        }
        let hit = if self.stack_size <= STACK_SIZE {
            NEAREST.with_borrow_mut(|stack| nearest_hit(self, ray, stack))
        } else {
            nearest_hit(self, ray, &mut vec![0; self.stack_size])
        };
        (hit.triangle != u32::MAX).then_some(hit)
    }

    /// Whether there is any hit with t in (t_min, t_max).
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        if self.stack_size <= STACK_SIZE {
            ANY.with_borrow_mut(|stack| any_hit(self, ray, stack))
        } else {
            any_hit(self, ray, &mut vec![0; self.stack_size + WIDTH])
        }
    }
}

/// A traversal, compiled for each instruction set.
macro_rules! dispatched {
    ($name:ident, $traverse:ident, $entry:ty, $found:ty) => {
        #[inline(always)]
        fn $name(bvh: &Bvh, ray: &Ray, stack: &mut [$entry]) -> $found {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,bmi1,bmi2,lzcnt,popcnt")]
            fn avx512(bvh: &Bvh, ray: &Ray, stack: &mut [$entry]) -> $found {
                $traverse::<Eight, Four>(bvh, ray, stack)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            fn avx2(bvh: &Bvh, ray: &Ray, stack: &mut [$entry]) -> $found {
                $traverse::<Eight, Four>(bvh, ray, stack)
            }
            match bvh.instructions {
                // SAFETY: `Bvh::instructions` is at most what `InstructionSet::widest` detected.
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx512 => unsafe { avx512(bvh, ray, stack) },
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx2 => unsafe { avx2(bvh, ray, stack) },
                _ => $traverse::<Portable<WIDTH>, Portable<GROUP>>(bvh, ray, stack),
            }
        }
    };
}

dispatched!(nearest_hit, nearest, Entry, Hit);
dispatched!(any_hit, any, u32, bool);

/// A stack entry: the child in the low half, the bits of its entry distance in the high half, so that entries sort by distance.
type Entry = u64;

#[inline(always)]
fn entry(child: Child, t: f32) -> Entry {
    u64::from(t.to_bits()) << 32 | u64::from(child.0)
}

/// The nearest hit in a non-empty hierarchy; its triangle is `u32::MAX` if there is none. `stack` has `Bvh::stack_size` entries.
#[inline(always)]
fn nearest<B: Lanes<WIDTH>, T: Lanes<GROUP>>(bvh: &Bvh, ray: &Ray, stack: &mut [Entry]) -> Hit {
    let mut nearest = Hit {
        t: ray.t_max,
        triangle: u32::MAX,
        ..Hit::default()
    };
    let (nodes, groups): (&[Node], &[Group]) = (&bvh.nodes, &bvh.groups);
    let inverse = reciprocal(ray.direction);
    let slabs = Slabs::<B>::new(ray, inverse);
    let shear = Shear::<T>::new(ray, inverse);
    let mut depth = 0;
    let mut current = Child::inner(0);
    loop {
        // Descend to the nearest child; push the others, sorted by distance.
        while !current.is_leaf() {
            let node = &nodes[current.0 as usize];
            let (near, mut mask) = slabs.intersect(node, nearest.t);
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
            let second = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let t = near.store();
            let entry_of = |lane: usize| entry(node.child(lane), t[lane & (WIDTH - 1)]);
            let (a, b) = (entry_of(first), entry_of(second));
            prefetch(nodes, groups, node.child(first));
            prefetch(nodes, groups, node.child(second));
            let (mut best, mut rest) = (a.min(b), a.max(b));
            let base = depth;
            while mask != 0 {
                let next = entry_of(mask.trailing_zeros() as usize);
                prefetch(nodes, groups, node.child(mask.trailing_zeros() as usize));
                mask &= mask - 1;
                insert(stack, base, depth, rest);
                depth += 1;
                (best, rest) = (best.min(next), best.max(next));
            }
            insert(stack, base, depth, rest);
            depth += 1;
            current = Child(best as u32);
        }

        // Test the triangles of a leaf.
        if current != Child::EMPTY {
            for group in &groups[current.groups()] {
                shear.nearest(group, &mut nearest);
            }
        }

        // Pop the next child that is nearer than the nearest hit.
        loop {
            if depth == 0 {
                return nearest;
            }
            depth -= 1;
            let next = stack[depth];
            if f32::from_bits((next >> 32) as u32) <= nearest.t {
                current = Child(next as u32);
                break;
            }
        }
    }
}

/// Inserts an entry into those from `base` to `depth`, which are sorted with the nearest on top.
#[inline(always)]
fn insert(stack: &mut [Entry], base: usize, depth: usize, entry: Entry) {
    let mut place = depth;
    while place > base && stack[place - 1] < entry {
        stack[place] = stack[place - 1];
        place -= 1;
    }
    stack[place] = entry;
}

/// Whether a ray hits anything in a non-empty hierarchy; `stack` has `Bvh::stack_size` + [`WIDTH`] entries.
#[inline(always)]
fn any<B: Lanes<WIDTH>, T: Lanes<GROUP>>(bvh: &Bvh, ray: &Ray, stack: &mut [u32]) -> bool {
    let (nodes, groups): (&[Node], &[Group]) = (&bvh.nodes, &bvh.groups);
    let inverse = reciprocal(ray.direction);
    let slabs = Slabs::<B>::new(ray, inverse);
    let shear = Shear::<T>::new(ray, inverse);
    let mut depth = 0;
    let mut current = Child::inner(0);
    loop {
        // Descend to the last intersected child, the one with the fewest triangles; push the others.
        while !current.is_leaf() {
            let node = &nodes[current.0 as usize];
            let (_, mask) = slabs.intersect(node, ray.t_max);
            if mask == 0 {
                current = Child::EMPTY;
                break;
            }
            let last = 31 - mask.leading_zeros();
            current = node.child(last as usize);
            let others = mask ^ 1 << last;
            if others != 0 {
                B::pack(&node.rows[Node::CHILDREN], others, &mut stack[depth..]);
                depth += others.count_ones() as usize;
            }
        }

        if current != Child::EMPTY {
            for group in &groups[current.groups()] {
                if shear.hits_any(group, ray.t_max) {
                    return true;
                }
            }
        }

        if depth == 0 {
            return false;
        }
        depth -= 1;
        current = Child(stack[depth]);
        if depth > 0 {
            prefetch(nodes, groups, Child(stack[depth - 1]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::STACK_SIZE;
    use crate::scene::bvh::Bvh;
    use crate::scene::geometry::Ray;
    use glam::Vec3;

    /// Triangles across the x axis, each a little farther and larger than the one before: nothing splits them evenly.
    fn chain() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let sizes = (-700..700).map(|step| 1.04f32.powi(step));
        let positions: Vec<Vec3> = sizes
            .flat_map(|x| {
                [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(1.0, y, z) * x)
            })
            .collect();
        let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
        let triangles = triangles.collect();
        (positions, triangles)
    }

    #[test]
    fn hierarchies_deeper_than_the_threads_stacks_are_traversed_whole() {
        let (positions, triangles) = chain();
        let bvh = Bvh::new(&positions, &triangles);
        assert!(bvh.stack_size > STACK_SIZE, "only {}", bvh.stack_size);
        for (index, _) in triangles.iter().enumerate().step_by(50) {
            // Between this triangle and the next, forward and back.
            let x = positions[3 * index].x;
            let origin = Vec3::X * x * 1.02;
            let hit = |direction| {
                let ray = Ray::new(origin, direction);
                let hit = bvh.intersect(&ray);
                assert_eq!(bvh.occluded(&ray), hit.is_some());
                hit.map(|hit| hit.triangle as usize)
            };
            let next = Some(index + 1).filter(|&next| next < triangles.len());
            assert_eq!(hit(Vec3::X), next);
            assert_eq!(hit(-Vec3::X), Some(index));
            // Across the line, nothing is met: each triangle lies in a plane of its own.
            assert_eq!(hit(Vec3::Y), None);
        }
    }
}
