//! Nearest-hit traversal.

use crate::scene::bvh::lanes::Lanes;
use crate::scene::bvh::shear::Shear;
use crate::scene::bvh::slabs::{Slabs, reciprocal};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, Node, WIDTH, prefetch};
use crate::scene::geometry::{Hit, Ray};

/// A stack entry: the child in the low half, the bits of its entry distance in the high half, so that entries sort by distance.
pub(super) type Entry = u64;

#[inline(always)]
fn entry(child: Child, t: f32) -> Entry {
    u64::from(t.to_bits()) << 32 | u64::from(child.0)
}

/// The nearest hit in a non-empty hierarchy; its triangle is `u32::MAX` if there is none. `stack` has `Bvh::stack_size` entries.
#[inline(always)]
pub(super) fn traverse<B: Lanes<WIDTH>, T: Lanes<GROUP>>(
    bvh: &Bvh,
    ray: &Ray,
    stack: &mut [Entry],
) -> Hit {
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
