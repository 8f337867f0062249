//! Traversal until any hit, in whichever order is cheapest.

use super::lanes::Lanes;
use super::shear::Shear;
use super::slabs::Slabs;
use super::{Bvh, Child, GROUP, Group, Node, WIDTH, prefetch};
use crate::scene::geometry::Ray;

/// Whether anything is hit in a hierarchy that holds something; `stack` holds `Bvh::stack_size` entries and
/// [`WIDTH`] more.
#[inline(always)]
pub(super) fn traverse<B: Lanes<WIDTH>, T: Lanes<GROUP>>(
    bvh: &Bvh,
    ray: &Ray,
    stack: &mut [u32],
) -> bool {
    let (nodes, groups): (&[Node], &[Group]) = (&bvh.nodes, &bvh.groups);
    let slabs = Slabs::<B>::new(ray);
    let shear = Shear::<T>::new(ray);
    let mut depth = 0;
    let mut current = Child::inner(0);
    loop {
        // Descend to the first child that is met, leaving the others on the stack.
        while !current.is_leaf() {
            let node = &nodes[current.0 as usize];
            let (_, mask) = slabs.meet(node, ray.t_max);
            if mask == 0 {
                current = Child::EMPTY;
                break;
            }
            current = node.child(mask.trailing_zeros() as usize);
            let others = mask & (mask - 1);
            if others != 0 {
                B::pack(&node.rows[Node::CHILDREN], others, &mut stack[depth..]);
                depth += others.count_ones() as usize;
            }
        }

        if current != Child::EMPTY {
            for group in &groups[current.groups()] {
                if shear.meets(group, ray.t_max) {
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
