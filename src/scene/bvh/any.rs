//! Any-hit traversal.

use crate::scene::bvh::lanes::Lanes;
use crate::scene::bvh::shear::Shear;
use crate::scene::bvh::slabs::{Slabs, reciprocal};
use crate::scene::bvh::{Bvh, Child, GROUP, Group, Node, WIDTH, prefetch};
use crate::scene::geometry::Ray;

/// Whether a ray hits anything in a non-empty hierarchy; `stack` has `Bvh::stack_size` + [`WIDTH`] entries.
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
