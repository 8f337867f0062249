//! Traversal until any hit, in whichever order is cheapest.

use crate::scene::bvh::lanes::Lanes;
use crate::scene::bvh::shear::Shear;
use crate::scene::bvh::slabs::{Slabs, reciprocal};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, Node, WIDTH, prefetch};
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
    let inverse = reciprocal(ray.direction);
    let slabs = Slabs::<B>::new(ray, inverse);
    let shear = Shear::<T>::new(ray, inverse);
    let mut depth = 0;
    let mut current = Child::inner(0);
    loop {
        // Descend to the last child that is met, the one with the fewest triangles; the others go onto the stack.
        while !current.is_leaf() {
            let node = &nodes[current.0 as usize];
            let (_, mask) = slabs.meet(node, ray.t_max);
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
