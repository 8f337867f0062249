//! Traversal towards the nearest hit.

use crate::scene::bvh::lanes::Lanes;
use crate::scene::bvh::shear::Shear;
use crate::scene::bvh::slabs::{Slabs, reciprocal};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, Node, WIDTH, prefetch};
use crate::scene::geometry::{Hit, Ray};

/// A child still to be visited, in the low half, and the bits of where the ray enters its box: ordered by distance.
pub(super) type Entry = u64;

#[inline(always)]
fn entry(child: Child, t: f32) -> Entry {
    u64::from(t.to_bits()) << 32 | u64::from(child.0)
}

/// The nearest hit in a hierarchy that holds something, `u32::MAX` its triangle where there is none; `stack` holds
/// `Bvh::stack_size` entries.
#[inline(always)]
pub(super) fn traverse<B: Lanes<WIDTH>, T: Lanes<GROUP>>(
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
    let inverse = reciprocal(ray.direction);
    let slabs = Slabs::<B>::new(ray, inverse);
    let shear = Shear::<T>::new(ray, inverse);
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
                let next = of(mask.trailing_zeros() as usize);
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

        // Take the next child that is still near enough.
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

/// Puts an entry among those from `base` to `depth`, of which the nearest lies on top.
#[inline(always)]
fn insert(stack: &mut [Entry], base: usize, depth: usize, entry: Entry) {
    let mut place = depth;
    while place > base && stack[place - 1] < entry {
        stack[place] = stack[place - 1];
        place -= 1;
    }
    stack[place] = entry;
}
